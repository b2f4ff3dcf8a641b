//! What happens when the firmware fails: its reason in the log, and the end of QEMU.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};

use super::host;

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    host::say(format_args!("{info}"));
    host::fail()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    cortex_m::interrupt::disable();
    host::say(format_args!("panicked: fault at {:#x}, called from {:#x}", frame.pc(), frame.lr()));
    host::fail()
}
