//! A timer that ticks once a character, for each line one of its own.

use puente_line::Duration;

use super::registers::{DUALTIMER, Registers, TIMER1};

/// Counts of a timer in 1 µs.
const COUNTS: u32 = 25;

/// A timer that counts down from a number again and again, with an interrupt at its end.
pub(super) struct Pacer {
    registers: Registers,
    /// Register of the number.
    period: usize,
    control: usize,
    clear: usize,
    /// What makes it run.
    run: u32,
    /// What a new period is written to as well, where it would count the old one to its end before.
    value: Option<usize>,
}

/// TIMER1: enabled, with interrupt.
pub(super) const LINE_A: Pacer =
    Pacer { registers: TIMER1, period: 0x08, control: 0x00, clear: 0x0C, run: 0b1001, value: Some(0x04) };
/// DUALTIMER, second timer: enabled, periodic, with interrupt, 32 bits wide.
pub(super) const LINE_B: Pacer =
    Pacer { registers: DUALTIMER, period: 0x20, control: 0x28, clear: 0x2C, run: 0xE2, value: None };

impl Pacer {
    /// Sets the time between two ticks.
    pub(super) fn set(&self, time: Duration) {
        let counts = (time.as_micros() as u32).saturating_mul(COUNTS);
        self.registers.write(self.period, counts.max(COUNTS));
    }

    /// Starts it: the first tick comes after a whole period.
    pub(super) fn run(&self) {
        let period = self.registers.read(self.period);
        self.registers.write(self.value.unwrap_or(self.period), period);
        self.registers.write(self.control, self.run);
    }

    /// Stops it.
    pub(super) fn stop(&self) {
        self.registers.write(self.control, 0);
        self.clear();
    }

    /// A tick has been seen.
    pub(super) fn clear(&self) {
        self.registers.write(self.clear, 1);
    }
}
