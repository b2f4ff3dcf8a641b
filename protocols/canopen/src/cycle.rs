//! Moments on an even grid.

use core::time::Duration;

use puente_line::{Instant, micros};

/// What comes every so often, on a grid: being late once makes nothing else late.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cycle {
    period: Duration,
    due: Option<Instant>,
}

impl Cycle {
    /// Not running.
    pub const fn new(period: Duration) -> Self {
        Self { period, due: None }
    }

    /// First due at `first`; never with a period of zero.
    pub fn start(&mut self, first: Instant) {
        self.due = (!self.period.is_zero()).then_some(first);
    }

    pub fn stop(&mut self) {
        self.due = None;
    }

    pub const fn period(&self) -> Duration {
        self.period
    }

    pub const fn due(&self) -> Option<Instant> {
        self.due
    }

    /// Whether it is due; then it is so next at the following moment of the grid, and the number of those that were
    /// passed over is said.
    pub fn take(&mut self, now: Instant) -> Option<u32> {
        let due = self.due.filter(|due| *due <= now)?;
        let period = micros(self.period).max(1);
        let passed = micros(now.since(due)) / period;
        let steps = passed.saturating_add(1);
        self.due = Some(Instant::from_micros(due.as_micros().saturating_add(steps.saturating_mul(period))));
        Some(u32::try_from(passed).unwrap_or(u32::MAX))
    }
}
