//! A place on the bus: what it wants to send, and what it has heard.

use std::collections::VecDeque;
use std::time::Duration;

use puente_canopen::Frame;

use super::counters::{Counters, State};
use super::{Heard, INBOX, SUSPENSION};

/// A frame that never waits for another one.
struct Babble {
    frame: Frame,
    from: u64,
    until: u64,
}

/// A controller with its queues. Frames go out in the order in which they were given.
pub struct Seat {
    pub inbox: VecDeque<Heard>,
    pub counters: Counters,
    pub longest_wait: Duration,
    outbox: VecDeque<(u64, Frame)>,
    babble: Option<Babble>,
    absent: bool,
    /// Not before: it lets others go first.
    suspended: u64,
}

impl Default for Seat {
    fn default() -> Self {
        Self {
            inbox: VecDeque::new(),
            counters: Counters::default(),
            longest_wait: Duration::ZERO,
            outbox: VecDeque::new(),
            babble: None,
            absent: false,
            suspended: 0,
        }
    }
}

impl Seat {
    pub fn set_present(&mut self, present: bool) {
        self.absent = !present;
        if self.absent {
            self.outbox.clear();
            self.babble = None;
        }
    }

    pub fn babble(&mut self, frame: Frame, from: u64, until: u64) {
        self.babble = Some(Babble { frame, from, until });
    }

    pub fn send(&mut self, now: u64, frame: Frame) {
        if !self.absent {
            self.outbox.push_back((now, frame));
        }
    }

    /// Forgets what waits, but for the first frame if that has `begun`.
    pub fn discard(&mut self, begun: bool) {
        self.outbox.truncate(usize::from(begun));
    }

    pub fn pending(&self) -> usize {
        self.outbox.len()
    }

    /// Whether it hears and acknowledges.
    pub fn hears(&self) -> bool {
        !self.absent && self.counters.state() != State::Off
    }

    pub fn hear(&mut self, heard: Heard) {
        if self.inbox.len() == INBOX {
            self.inbox.pop_front();
        }
        self.inbox.push_back(heard);
    }

    /// From when on it wants the bus, which is free from `free` on and idle since `idle`; `None` while it wants nothing.
    pub fn ready_at(&self, free: u64, idle: u64, bit: u64) -> Option<u64> {
        if self.absent {
            return None;
        }
        let babble = self.babble.as_ref().map(|babble| babble.from.max(free)).filter(|at| self.babbles(*at));
        let queued = self.outbox.front().map(|(at, _)| *at);
        let wants = [queued, babble].into_iter().flatten().min()?;
        let on =
            if self.counters.state() == State::Off { idle + self.counters.recovers_in() * bit } else { 0 };
        Some(wants.max(self.suspended).max(on))
    }

    fn babbles(&self, at: u64) -> bool {
        self.babble.as_ref().is_some_and(|babble| babble.from <= at && at < babble.until)
    }

    /// What it sends at a moment.
    pub fn offer(&self, at: u64) -> Option<Frame> {
        match &self.babble {
            Some(babble) if self.babbles(at) => Some(babble.frame),
            _ => self.outbox.front().map(|(_, frame)| *frame),
        }
    }

    /// Its frame, which began at `begin`, went over the bus, which is free from `free` on; how long it waited, ns.
    pub fn sent(&mut self, begin: u64, free: u64, bit: u64) -> u64 {
        self.counters.sent();
        self.suspend(free, bit);
        if self.babbles(begin) {
            return 0;
        }
        let queued = self.outbox.pop_front().map_or(begin, |(at, _)| at);
        let waited = begin.saturating_sub(queued);
        self.longest_wait = self.longest_wait.max(Duration::from_nanos(waited));
        waited
    }

    /// Its frame did not get through; it tries again.
    pub fn failed(&mut self, unacknowledged: bool, free: u64, bit: u64) {
        self.counters.transmit_error(unacknowledged);
        self.suspend(free, bit);
    }

    fn suspend(&mut self, free: u64, bit: u64) {
        if self.counters.state() == State::Passive {
            self.suspended = free + SUSPENSION * bit;
        }
    }
}
