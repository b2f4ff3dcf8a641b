//! TIME (7.2.6).

use core::time::Duration;

use puente_line::Instant;

use crate::cycle::Cycle;
use crate::frame::{Frame, Id};

/// Days from 1970-01-01 to 1984-01-01.
const EPOCH: u64 = 5_113;
const DAY: u64 = 86_400_000;

/// TIME_OF_DAY (7.1.6): milliseconds after midnight, and days since 1984-01-01.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct TimeOfDay {
    days: u16,
    millis: u32,
}

impl TimeOfDay {
    /// Bits that hold the milliseconds.
    const MILLIS: u32 = 0x0FFF_FFFF;

    /// A time; `None` where `millis` is a day or more.
    pub const fn new(days: u16, millis: u32) -> Option<Self> {
        if (millis as u64) < DAY { Some(Self { days, millis }) } else { None }
    }

    /// The time `millis` milliseconds after 1970-01-01; `None` before 1984 and from 2163-06-07 on.
    pub fn from_unix_millis(millis: u64) -> Option<Self> {
        let days = u16::try_from((millis / DAY).checked_sub(EPOCH)?).ok()?;
        Some(Self { days, millis: (millis % DAY) as u32 })
    }

    /// Milliseconds after 1970-01-01.
    pub const fn to_unix_millis(self) -> u64 {
        (self.days as u64 + EPOCH) * DAY + self.millis as u64
    }

    /// Days since 1984-01-01.
    pub const fn days(self) -> u16 {
        self.days
    }

    /// Milliseconds after midnight, less than a day.
    pub const fn millis(self) -> u32 {
        self.millis
    }

    /// Six bytes: 28 bits of milliseconds, 4 of nothing, 16 of days, the low byte first.
    pub const fn to_bytes(self) -> [u8; 6] {
        let [a, b, c, d] = self.millis.to_le_bytes();
        let [e, f] = self.days.to_le_bytes();
        [a, b, c, d, e, f]
    }

    /// See [`TimeOfDay::to_bytes`]; `None` where the milliseconds are a day or more.
    pub const fn from_bytes([a, b, c, d, e, f]: [u8; 6]) -> Option<Self> {
        Self::new(u16::from_le_bytes([e, f]), u32::from_le_bytes([a, b, c, d]) & Self::MILLIS)
    }

    /// The frame that tells it; `id` is 100h unless 1012h says otherwise.
    pub fn frame(self, id: u16) -> Frame {
        Frame::of(Id::base(id), self.to_bytes())
    }

    /// The time in a frame with COB-ID `id`; `None` where it tells none.
    pub fn parse(id: u16, frame: &Frame) -> Option<Self> {
        Self::from_bytes(frame.data_of(id)?.try_into().ok()?)
    }
}

/// Tells the time every so often. Time of day is the caller's.
#[derive(Clone, Debug)]
pub struct Producer {
    id: u16,
    cycle: Cycle,
}

impl Producer {
    /// One that does not run yet; a period of zero never produces.
    pub const fn new(id: u16, period: Duration) -> Self {
        Self { id, cycle: Cycle::new(period) }
    }

    /// First due at `first`.
    pub fn start(&mut self, first: Instant) {
        self.cycle.start(first);
    }

    /// No more.
    pub fn stop(&mut self) {
        self.cycle.stop();
    }

    /// The frame that is due. Without a time of day there is none, and the moment passes.
    pub fn poll(&mut self, now: Instant, time: Option<TimeOfDay>) -> Option<Frame> {
        self.cycle.take(now)?;
        Some(time?.frame(self.id))
    }

    /// When it is due.
    pub const fn poll_at(&self) -> Option<Instant> {
        self.cycle.due()
    }
}
