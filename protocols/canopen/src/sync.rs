//! SYNC (7.2.5).

use core::time::Duration;

use puente_line::Instant;

use crate::cob;
use crate::cycle::Cycle;
use crate::frame::{Frame, Id};

/// The counter in SYNC: 1 up to its overflow value, again and again (1019h).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overflow(u8);

impl Overflow {
    /// Counts up to `last`, 2 to 240; `None` for others, which the standard reserves.
    pub const fn new(last: u8) -> Option<Self> {
        match last {
            2..=240 => Some(Self(last)),
            _ => None,
        }
    }

    /// The last count, 2 to 240.
    pub const fn last(self) -> u8 {
        self.0
    }
}

/// Produces SYNC on an even grid: a late call moves one SYNC, not those after it.
#[derive(Clone, Debug)]
pub struct Producer {
    id: u16,
    overflow: Option<Overflow>,
    count: u8,
    cycle: Cycle,
    missed: u32,
}

impl Producer {
    /// One that does not run yet. `period` is 1006h, whole microseconds; zero never produces. `id` is 80h unless 1005h says
    /// otherwise; with an `overflow`, SYNC carries a counter.
    pub const fn new(id: u16, period: Duration, overflow: Option<Overflow>) -> Self {
        Self { id, overflow, count: 0, cycle: Cycle::new(period), missed: 0 }
    }

    /// As delivered: no counter, COB-ID 80h.
    pub const fn plain(period: Duration) -> Self {
        Self::new(cob::SYNC, period, None)
    }

    /// The first SYNC is due at `first`; the counter begins with 1.
    pub fn start(&mut self, first: Instant) {
        self.count = 0;
        self.cycle.start(first);
    }

    /// No more SYNC.
    pub fn stop(&mut self) {
        self.cycle.stop();
    }

    /// The SYNC that is due. Those whose moment has passed with their whole period are left out, and counted.
    pub fn poll(&mut self, now: Instant) -> Option<Frame> {
        let missed = self.cycle.take(now)?;
        self.missed = self.missed.saturating_add(missed);
        let id = Id::base(self.id);
        Some(match self.overflow {
            None => Frame::of(id, []),
            Some(Overflow(last)) => {
                self.count = if self.count >= last { 1 } else { self.count + 1 };
                Frame::of(id, [self.count])
            }
        })
    }

    /// When SYNC is due.
    pub const fn poll_at(&self) -> Option<Instant> {
        self.cycle.due()
    }

    /// How many were left out since it was made.
    pub const fn missed(&self) -> u32 {
        self.missed
    }
}

/// The counter of a SYNC with COB-ID `id`: none in a SYNC without data; `None` where the frame is no SYNC.
pub fn parse(id: u16, frame: &Frame) -> Option<Option<u8>> {
    match frame.data_of(id)? {
        [] => Some(None),
        [count @ 1..=240] => Some(Some(*count)),
        _ => None,
    }
}
