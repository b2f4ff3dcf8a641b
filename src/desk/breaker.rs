//! The circuit breaker: a slave that does not answer may cost the others one reply time-out a probe, and no more.

use heapless::LinearMap;
use puente_line::{Duration, Instant};

/// Slaves that can be out of order at once on a bus; of more than that, the ones that failed last are remembered.
const FAILING: usize = 32;
/// A slave rests this many reply time-outs, so that probing it takes at most a tenth of the line.
const REST_FACTOR: u32 = 9;
/// Bounds of the rest: long enough to matter, short enough that a drive switched on again is soon found.
const REST: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(10));

#[derive(Clone, Copy)]
struct Failing {
    misses: u8,
    /// From when on the slave may be asked again.
    until: Instant,
}

pub(super) struct Breaker {
    rest: Duration,
    failing: LinearMap<u8, Failing, FAILING>,
    /// One bit a unit: has answered since start-up.
    alive: [u32; 8],
}

impl Breaker {
    pub(super) fn new(reply_timeout: Duration) -> Self {
        let rest = reply_timeout.saturating_mul(REST_FACTOR).clamp(REST.0, REST.1);
        Self { rest, failing: LinearMap::new(), alive: [0; 8] }
    }

    /// How long the slave still rests; none where it may be asked.
    pub(super) fn rest(&self, unit: u8, now: Instant) -> Option<Duration> {
        let until = self.failing.get(&unit)?.until;
        (until > now).then(|| until.since(now))
    }

    /// How many slaves are resting or awaiting a probe.
    pub(super) fn resting(&self) -> usize {
        self.failing.values().filter(|failing| failing.until > Instant::ZERO).count()
    }

    pub(super) fn answered(&mut self, unit: u8) {
        self.failing.remove(&unit);
        if let Some(word) = self.alive.get_mut(usize::from(unit / 32)) {
            *word |= 1 << (unit % 32);
        }
    }

    /// A slave that has answered before may miss once, for a disturbed line loses frames; one never heard may not.
    pub(super) fn missed(&mut self, unit: u8, now: Instant) {
        let alive = self.alive.get(usize::from(unit / 32)).is_some_and(|word| word & (1 << (unit % 32)) != 0);
        let allowed = if alive { 2 } else { 1 };
        let misses = self.failing.get(&unit).map_or(0, |failing| failing.misses).saturating_add(1);
        let until = if misses >= allowed { now + self.rest } else { Instant::ZERO };
        if self.failing.len() == FAILING && !self.failing.contains_key(&unit) {
            let oldest = self.failing.iter().min_by_key(|(_, failing)| failing.until).map(|(unit, _)| *unit);
            oldest.and_then(|unit| self.failing.remove(&unit));
        }
        // There is room: an entry was removed above where there was none.
        let _ = self.failing.insert(unit, Failing { misses, until });
    }
}
