//! The independent watchdog over the loop, IWDG. It counts by an oscillator of its own, LSI: 32 kHz, 5 % more or less.

use embassy_stm32::pac::IWDG;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

/// Counts of a period, at a quarter of LSI: 10 ms, a hundred steps of the loop. Nothing else takes the current from the
/// amplifier when the loop hangs.
const COUNTS: u16 = 80;

/// The watchdog. Nothing but a reset ends it.
pub(super) struct Watchdog(());

impl Watchdog {
    pub fn new() -> Self {
        Self(())
    }

    /// Puts the reset off for another period.
    pub fn feed(&mut self) {
        IWDG.kr().write(|w| w.set_key(Key::RESET));
    }
}

/// Starts it: from now on it has to be fed. It runs on while a debugger halts the processor, for the amplifier does so too.
pub(super) fn start() {
    IWDG.kr().write(|w| w.set_key(Key::START));
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    while IWDG.sr().read().pvu() {}
    IWDG.pr().write(|w| w.set_pr(Pr::DIVIDE_BY4));
    while IWDG.sr().read().rvu() {}
    IWDG.rlr().write(|w| w.set_rl(COUNTS));
    while IWDG.sr().read().pvu() || IWDG.sr().read().rvu() {}
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}
