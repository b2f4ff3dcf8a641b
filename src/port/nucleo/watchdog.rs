//! The independent watchdog, IWDG: it counts by an oscillator of its own, LSI.

use embassy_stm32::pac::DBGMCU;
#[cfg(not(feature = "nucleo-h753zi"))]
use embassy_stm32::pac::IWDG;
#[cfg(feature = "nucleo-h753zi")]
use embassy_stm32::pac::IWDG1 as IWDG;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

use crate::port::embedded::vital;

/// Counts of a period. With LSI's nominal 32 kHz over 16 it is 2 s: 1.4 s to 3.8 s over the 17 to 47 kHz that LSI may
/// have on an F7. Short, for nothing stops an axis while its bus task hangs; and many times as long as anything holds
/// the processor that does not hang.
const COUNTS: u16 = 4000;
const NARROW: Pr = Pr::DIVIDE_BY16;
/// 16 s: an erase of flash halts the processor for up to 4 s where code is in the same bank.
const WIDE: Pr = Pr::DIVIDE_BY128;

/// The running watchdog. Nothing but a reset ends it.
pub struct Watchdog(());

impl Watchdog {
    /// Starts it: from now on it has to be fed.
    pub fn start() -> Self {
        // It stands still while a debugger halts the processor.
        #[cfg(feature = "nucleo-h753zi")]
        DBGMCU.apb4fzr1().modify(|halted| halted.set_iwdg1(true));
        #[cfg(not(feature = "nucleo-h753zi"))]
        DBGMCU.apb1fzr().modify(|halted| halted.set_iwdg(true));
        IWDG.kr().write(|w| w.set_key(Key::START));
        set(NARROW);
        Self(())
    }

    /// Puts the reset off for another period.
    pub fn feed(&mut self) {
        vital::alive();
        IWDG.kr().write(|w| w.set_key(Key::RESET));
    }
}

/// Gives the watchdog the period of an erase of flash.
#[allow(dead_code, reason = "for settings in flash")]
pub(in crate::port) fn widen() {
    set(WIDE);
}

/// Takes that back.
#[allow(dead_code, reason = "for settings in flash")]
pub(in crate::port) fn narrow() {
    set(NARROW);
}

/// A new period, from now on. It takes LSI a few of its cycles to take each register over.
fn set(divider: Pr) {
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    while IWDG.sr().read().pvu() {}
    IWDG.pr().write(|w| w.set_pr(divider));
    while IWDG.sr().read().rvu() {}
    IWDG.rlr().write(|w| w.set_rl(COUNTS));
    while IWDG.sr().read().pvu() || IWDG.sr().read().rvu() {}
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}
