//! Two executors, each in an interrupt: that of the bus tasks above that of the network. Thread mode has nothing to do
//! but to wait, in WFI: embassy's executor for thread mode waits in WFE, for which QEMU does not idle.

use core::sync::atomic::{AtomicPtr, Ordering};

use embassy_executor::{InterruptExecutor, SendSpawner, Spawner, raw};
use static_cell::StaticCell;

use super::interrupt::{Interrupt, enable};
use crate::port::embedded::{started, vital};

static BUSES: InterruptExecutor = InterruptExecutor::new();
/// The executor of the network, once it is there.
static CLIENTS: AtomicPtr<raw::Executor> = AtomicPtr::new(core::ptr::null_mut());

/// Runs the tasks that `start` spawns, and those that they spawn, for ever. Call it once, from `main`.
pub fn run(start: impl FnOnce(Spawner)) -> ! {
    static EXECUTOR: StaticCell<raw::Executor> = StaticCell::new();
    // The context is what embassy's pender takes for the number of the interrupt to raise.
    let executor: &'static raw::Executor =
        EXECUTOR.init(raw::Executor::new(Interrupt::Clients as usize as *mut ()));
    start(executor.spawner());
    started();
    CLIENTS.store(core::ptr::from_ref(executor).cast_mut(), Ordering::Release);
    enable(Interrupt::Clients);
    loop {
        cortex_m::asm::wfi();
    }
}

/// Starts the executor of the bus tasks.
pub(super) fn start() -> SendSpawner {
    BUSES.start(Interrupt::Buses)
}

/// The interrupt of the network's executor.
pub(super) fn clients() {
    // SAFETY: null, or the executor of `run`, which is never moved, dropped or changed through another reference.
    if let Some(executor) = unsafe { CLIENTS.load(Ordering::Acquire).as_ref() } {
        // SAFETY: only here; an interrupt does not interrupt itself.
        unsafe { executor.poll() }
    }
}

/// The interrupt of the bus tasks' executor.
pub(super) fn buses() {
    // SAFETY: this is the executor's interrupt, and only `start` enables it.
    vital::bus_turn(|| unsafe { BUSES.on_interrupt() });
}
