//! The executor of the bus tasks. It runs in an interrupt, so that no amount of network traffic delays a bus.

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};

static BUSES: InterruptExecutor = InterruptExecutor::new();

/// Starts the executor. The interrupt is SAI1's, which every board has and nothing here uses.
pub(super) fn start() -> SendSpawner {
    interrupt::SAI1.set_priority(Priority::P6);
    BUSES.start(interrupt::SAI1)
}

#[embassy_stm32::interrupt]
unsafe fn SAI1() {
    // SAFETY: this is the executor's interrupt, and only `start` enables it.
    unsafe { BUSES.on_interrupt() }
}
