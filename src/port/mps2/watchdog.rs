//! The watchdog: CMSDK (Arm DDI 0479).

use cortex_m_rt::exception;

use super::registers::WATCHDOG;
use crate::port::embedded::vital;

const LOAD: usize = 0x00;
const CONTROL: usize = 0x08;
const INTERRUPT_CLEAR: usize = 0x0C;
const LOCK: usize = 0xC00;

/// Counts, and resets the board when it has come to its end twice; the first time there is an NMI.
const RUNS: u32 = 0b11;
/// Opens the registers for writing.
const KEY: u32 = 0x1ACC_E551;
/// Counts of a period, at 25 MHz: 2 s, as on the Nucleo boards.
const PERIOD: u32 = 50_000_000;
/// Counts from the NMI to the reset: 1 ms.
const REST: u32 = 25_000;

/// The running watchdog.
pub struct Watchdog(());

impl Watchdog {
    /// Starts it: from now on it has to be fed.
    pub fn start() -> Self {
        WATCHDOG.write(LOCK, KEY);
        WATCHDOG.write(LOAD, PERIOD);
        WATCHDOG.write(CONTROL, RUNS);
        Self(())
    }

    /// Puts the reset off for another period.
    pub fn feed(&mut self) {
        vital::alive();
        WATCHDOG.write(INTERRUPT_CLEAR, 1);
    }
}

/// The period is over: nothing but this runs until the reset. The board has no flags that would tell of it then.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    vital::starved();
    WATCHDOG.write(LOAD, REST);
    loop {
        cortex_m::asm::nop();
    }
}
