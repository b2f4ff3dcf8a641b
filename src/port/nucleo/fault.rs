//! What happens when the firmware fails: one line in the log, and a new start.

use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    defmt::error!("{}", defmt::Display2Format(info));
    restart()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    cortex_m::interrupt::disable();
    defmt::error!("fault at {=u32:#x}, called from {=u32:#x}", frame.pc(), frame.lr());
    restart()
}

/// A debugger needs a moment to fetch the last line before the memory is written anew.
fn restart() -> ! {
    cortex_m::asm::delay(40_000_000);
    crate::port::restart()
}
