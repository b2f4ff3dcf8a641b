//! Stations that behave badly. They join with [`crate::Place::judged`] off.

use std::time::Duration;

use puente_framed::Random;
use puente_line::{Instant, Settings};

use crate::heard::{Drive, Heard, Node};

/// Characters that a [`Babbler`] sends at a time.
const CHUNK: usize = 64;

/// Talks from one time to another without listening.
#[derive(Clone, Debug)]
pub struct Babbler {
    line: Settings,
    next: Instant,
    until: Instant,
    random: Random,
}

impl Babbler {
    /// Talks from `from` until `until`.
    pub fn new(line: Settings, from: Instant, until: Instant, seed: u64) -> Self {
        Self { line, next: from, until, random: Random::new(seed) }
    }
}

impl Node for Babbler {
    fn hear(&mut self, _now: Instant, _heard: Heard) {}

    fn carrier(&mut self, _now: Instant) {}

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        if now < self.next || now >= self.until {
            return None;
        }
        // A microsecond less than it takes, lest a pause come between two chunks.
        self.next = now + (self.line.wire_time(CHUNK) - Duration::from_micros(1));
        Some(Drive::Transmit((0..CHUNK).map(|_| self.random.bits(8) as u8).collect()))
    }

    fn poll_at(&self) -> Option<Instant> {
        (self.next < self.until).then_some(self.next)
    }
}
