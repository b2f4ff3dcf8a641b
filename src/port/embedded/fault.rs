//! What happens when the firmware fails: it is recorded and said, and the board starts anew.

use core::fmt;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};

use super::{restart, vital};
use crate::port::platform;
use crate::port::record::Reset;

/// Of a longer path the end is enough.
const PATH: usize = 48;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let message = info.message();
    match info.location() {
        Some(at) => {
            let file = at.file();
            let file = file.get(file.len().saturating_sub(PATH)..).unwrap_or(file);
            fail(Reset::Panic, format_args!("{file}:{}: {message}", at.line()))
        }
        None => fail(Reset::Panic, format_args!("{message}")),
    }
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    fail(Reset::Fault, format_args!("fault at {:#x}, called from {:#x}", frame.pc(), frame.lr()))
}

fn fail(cause: Reset, text: fmt::Arguments<'_>) -> ! {
    static FAILED: AtomicBool = AtomicBool::new(false);
    cortex_m::interrupt::disable();
    platform::disarm();
    // What fails while it tells of a failure is not told.
    if !FAILED.swap(true, Ordering::Relaxed) {
        vital::crashed(cause, text);
        platform::last_words(format_args!("panicked: {text}"));
    }
    vital::reason(cause);
    restart()
}
