//! The loop's interrupt.

use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::peripherals::TIM7;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{RoundTo, Timer};
use embassy_stm32::{Peri, interrupt, pac};

use super::watchdog;
use crate::port::Step;
use crate::port::embedded::tick;

/// The timer of the loop.
pub struct Tick(Peri<'static, TIM7>);

impl Tick {
    pub(super) fn new(timer: Peri<'static, TIM7>) -> Self {
        Self(timer)
    }

    /// Does `step` so many times a second from now on, above everything else. The watchdog runs from then on.
    pub fn start(self, rate: u32, step: &'static dyn Step) {
        tick::set(step);
        let timer = Timer::new(self.0);
        timer.set_frequency(Hertz(rate), RoundTo::Faster);
        timer.enable_update_interrupt(true);
        watchdog::start();
        timer.start();
        // It runs for ever.
        core::mem::forget(timer);
        interrupt::TIM7_DAC.set_priority(Priority::P0);
        // SAFETY: no code relies on this interrupt being masked; critical sections mask all.
        unsafe { interrupt::TIM7_DAC.enable() };
    }
}

#[embassy_stm32::interrupt]
unsafe fn TIM7_DAC() {
    pac::TIM7.sr().write(|flags| flags.set_uif(false));
    tick::ticked();
}
