//! Two executors: one in thread mode, for the network where there is one, and that of the bus tasks in an interrupt, so
//! that no amount of network traffic delays a bus.

use embassy_executor::{Executor, InterruptExecutor, SendSpawner, Spawner};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use static_cell::StaticCell;

use crate::port::embedded::{started, vital};

static BUSES: InterruptExecutor = InterruptExecutor::new();

/// Runs the tasks that `start` spawns, and those that they spawn, for ever. Call it once, from `main`.
pub fn run(start: impl FnOnce(Spawner)) -> ! {
    static CLIENTS: StaticCell<Executor> = StaticCell::new();
    CLIENTS.init(Executor::new()).run(|spawner| {
        start(spawner);
        started();
    })
}

/// Starts the executor of the bus tasks. The interrupt is SAI1's, which every board has and nothing here uses.
pub(in crate::port) fn start() -> SendSpawner {
    interrupt::SAI1.set_priority(Priority::P6);
    BUSES.start(interrupt::SAI1)
}

#[embassy_stm32::interrupt]
unsafe fn SAI1() {
    // SAFETY: this is the executor's interrupt, and only `start` enables it.
    vital::bus_turn(|| unsafe { BUSES.on_interrupt() });
}
