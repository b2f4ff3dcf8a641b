//! The watchdog: CMSDK (Arm DDI 0479).

use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::exception;

use super::registers::WATCHDOG;
use crate::port::embedded::vital;

const LOAD: usize = 0x00;
const CONTROL: usize = 0x08;
const INTERRUPT_CLEAR: usize = 0x0C;
const LOCK: usize = 0xC00;

/// Counts, and raises an NMI at its end; at its second end without one being cleared it resets the board.
const RUNS: u32 = 0b11;
/// Opens the registers for writing.
const KEY: u32 = 0x1ACC_E551;
/// Counts of a period, at 25 MHz: 1 s. The second end without food counts, which makes 2 s as on the Nucleo boards; the
/// first may come without any fault of the firmware, because the counter goes on while the PC does not run QEMU.
const PERIOD: u32 = 25_000_000;
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
        self.refresh();
    }

    /// The same without a note of the time.
    pub(super) fn refresh(&mut self) {
        HUNGRY.store(false, Ordering::Relaxed);
        WATCHDOG.write(INTERRUPT_CLEAR, 1);
    }
}

/// A period is over without food.
static HUNGRY: AtomicBool = AtomicBool::new(false);

/// A period is over. After the second in a row nothing but this runs until the reset. The board has no flags that would
/// tell of it then.
#[exception]
unsafe fn NonMaskableInt() {
    if !HUNGRY.load(Ordering::Relaxed) {
        HUNGRY.store(true, Ordering::Relaxed);
        WATCHDOG.write(INTERRUPT_CLEAR, 1);
        return;
    }
    vital::starved();
    WATCHDOG.write(LOAD, REST);
    loop {
        cortex_m::asm::nop();
    }
}
