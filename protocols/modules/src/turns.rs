//! When answers are given: the [crate] says why.

use core::time::Duration;

use puente_framed::frame::TAGGED_OVERHEAD;
use puente_framed::{Frame, arbiter, section};
use puente_line::Instant;

use crate::report;

/// Bytes of a report's frame.
const REPORT: usize = TAGGED_OVERHEAD + section::OVERHEAD + report::DATA;
/// Bytes of a receipt's, or of a refusal's.
const RECEIPT: usize = TAGGED_OVERHEAD + section::OVERHEAD;

/// The times of a line's answers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turns {
    gap: Duration,
    /// Time on the line.
    report: Duration,
    receipt: Duration,
    /// What an answer may be late by.
    slot: Duration,
}

impl Turns {
    pub fn new(line: &arbiter::Config) -> Self {
        let time = |bytes| line.line.wire_time(bytes);
        Self { gap: line.gap, report: time(REPORT), receipt: time(RECEIPT), slot: line.slot + line.latency }
    }

    /// When to submit the report of the `turn`-th that was asked, counted from 0, in a frame that has ended now.
    pub fn report_at(&self, now: Instant, turn: u32) -> Instant {
        at(now, turn, self.gap, self.report)
    }

    /// The same of a receipt.
    pub fn receipt_at(&self, now: Instant, turn: u32) -> Instant {
        at(now, turn, self.gap, self.receipt)
    }

    /// When the last of `count` reports has come, if at all, of those that were asked in a frame that has ended now.
    pub fn reports_until(&self, now: Instant, count: u32) -> Instant {
        now + self.gap.saturating_add(self.report).saturating_mul(count) + self.slot
    }

    /// How many reports come in such a time.
    pub fn reports_in(&self, time: Duration) -> usize {
        let each = puente_line::micros(self.gap.saturating_add(self.report)).max(1);
        usize::try_from(puente_line::micros(time) / each).unwrap_or(usize::MAX)
    }
}

fn at(now: Instant, turn: u32, gap: Duration, answer: Duration) -> Instant {
    match turn {
        // The arbiter leaves the gap.
        0 => now,
        turn => {
            let turns = gap.saturating_add(answer).saturating_mul(turn);
            now + gap.saturating_add(turns).saturating_sub(answer / 2)
        }
    }
}

/// Which turn the section for `address` has among those that ask; `None` unless it does.
pub(crate) fn turn(frame: &Frame<'_>, address: u8, asks: impl Fn(&[u8]) -> bool) -> Option<u32> {
    let mut turn = 0;
    for section in frame.sections().filter(|section| section.address != section::NOBODY) {
        let asks = asks(section.data);
        if section.address == address {
            return asks.then_some(turn);
        }
        turn += u32::from(asks);
    }
    None
}

/// Whether the data of a section ask, in whichever form they are: an order is what comes last, before any zeros.
pub(crate) fn asks(data: &[u8]) -> bool {
    data.iter().rfind(|byte| **byte != 0).is_some_and(|digit| matches!(digit, b'4'..=b'7'))
}
