//! The loop's interrupt: SysTick.

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m::peripheral::{SCB, SYST};
use cortex_m_rt::exception;

use crate::port::Step;
use crate::port::embedded::tick;

/// The processor's clock, 25 MHz.
const CLOCK: u32 = 25_000_000;

/// The timer of the loop.
pub struct Tick {
    timer: SYST,
    priorities: SCB,
}

impl Tick {
    pub(super) fn new(timer: SYST, priorities: SCB) -> Self {
        Self { timer, priorities }
    }

    /// Does `step` so many times a second from now on, above everything else.
    pub fn start(mut self, rate: u32, step: &'static dyn Step) {
        tick::set(step);
        // SAFETY: no code relies on priorities for exclusion; critical sections mask all interrupts.
        unsafe { self.priorities.set_priority(SystemHandler::SysTick, 0x00) }
        self.timer.set_clock_source(SystClkSource::Core);
        self.timer.set_reload(CLOCK / rate - 1);
        self.timer.clear_current();
        self.timer.enable_interrupt();
        self.timer.enable_counter();
    }
}

#[exception]
unsafe fn SysTick() {
    tick::ticked();
}
