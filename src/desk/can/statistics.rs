//! What is counted on a CANopen bus.

use core::num::NonZeroU32;

use puente_canopen::{Frame, manager};
use puente_line::{Duration, Instant};

use crate::port::{CanCounters, CanState};

/// The load of a bus is that of so long.
const SPAN: Duration = Duration::from_secs(1);

/// What was counted on a CANopen bus. Counters are modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CanStatistics {
    /// State of the port.
    pub state: CanState,
    /// Frames of others.
    pub received: u32,
    /// Frames of the gateway, those of its clients among them.
    pub sent: u32,
    /// Bits of all frames with their stuff bits and the pause after each, modulo 2^64.
    pub bits: u64,
    /// Bits of the last second for which they were counted, in thousandths of what the bit rate has room for.
    pub load_permille: u32,
    /// Of clients' own frames, those that were not sent.
    pub undelivered: u32,
    /// What clients that follow the bus were too slow for.
    pub lost: u32,
    /// SDO transfers that wait for their turn.
    pub waiting: usize,
    /// SDO transfers of clients that were not begun.
    pub not_sent: u32,
    /// Of the port.
    pub port: CanCounters,
    /// Of the manager.
    pub manager: manager::Counters,
}

/// The same while it is being counted.
#[derive(Default)]
pub(super) struct Counted {
    counted: CanStatistics,
    /// Bits of the second that has begun, and of the one before.
    span: u32,
    last: u32,
    since: Instant,
}

impl Counted {
    pub(super) fn received(&mut self, now: Instant, frame: &Frame) {
        self.counted.received = self.counted.received.wrapping_add(1);
        self.load(now, frame.bits());
    }

    pub(super) fn sent(&mut self, now: Instant, frame: &Frame) {
        self.counted.sent = self.counted.sent.wrapping_add(1);
        self.load(now, frame.bits());
    }

    pub(super) fn undelivered(&mut self) {
        self.counted.undelivered = self.counted.undelivered.wrapping_add(1);
    }

    pub(super) fn not_sent(&mut self) {
        self.counted.not_sent = self.counted.not_sent.wrapping_add(1);
    }

    pub(super) fn lost(&mut self, count: NonZeroU32) {
        self.counted.lost = self.counted.lost.wrapping_add(count.get());
    }

    pub(super) fn counters(&mut self, port: CanCounters, manager: manager::Counters) {
        (self.counted.port, self.counted.manager) = (port, manager);
    }

    fn load(&mut self, now: Instant, bits: u32) {
        self.elapse(now);
        self.counted.bits = self.counted.bits.wrapping_add(bits.into());
        self.span = self.span.saturating_add(bits);
    }

    /// A second is over, or several.
    fn elapse(&mut self, now: Instant) {
        let elapsed = now.since(self.since);
        if elapsed >= SPAN {
            self.last = if elapsed < SPAN * 2 { self.span } else { 0 };
            self.span = 0;
            self.since = if elapsed < SPAN * 2 { self.since + SPAN } else { now };
        }
    }

    pub(super) fn statistics(
        &mut self,
        now: Instant,
        state: CanState,
        bitrate: u32,
        waiting: usize,
    ) -> CanStatistics {
        self.elapse(now);
        let load = u64::from(self.last) * 1000 / u64::from(bitrate.max(1));
        CanStatistics { state, waiting, load_permille: load as u32, ..self.counted }
    }
}

#[cfg(test)]
mod tests {
    use puente_canopen::Id;

    use super::*;

    #[test]
    fn the_load_is_that_of_the_last_whole_second() {
        let mut counted = Counted::default();
        let at = Instant::from_millis;
        let frame = Frame::full(Id::base(0x123), [0x5A; 8]);
        let load = |counted: &mut Counted, ms| {
            counted.statistics(at(ms), CanState::Active, 1_000_000, 0).load_permille
        };
        for ms in 10_000..11_000 {
            counted.received(at(ms), &frame);
            counted.sent(at(ms), &frame);
        }
        assert_eq!(load(&mut counted, 10_999), 0, "not a whole one yet");
        let whole = 2 * frame.bits();
        assert_eq!(load(&mut counted, 11_000), whole);
        assert_eq!(load(&mut counted, 11_999), whole);
        assert_eq!(load(&mut counted, 12_000), 0, "nothing since");
        let all = counted.statistics(at(12_000), CanState::Active, 1_000_000, 0);
        assert_eq!((all.received, all.sent, all.bits), (1000, 1000, 1000 * u64::from(whole)));
        // After a pause the seconds begin anew.
        counted.received(at(20_300), &frame);
        assert_eq!(load(&mut counted, 21_299), 0);
        assert_eq!(load(&mut counted, 21_300), frame.bits() / 1000);
    }
}
