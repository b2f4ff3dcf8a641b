//! A place on the bus: what it wants to send, and what it has heard.

use std::collections::VecDeque;
use std::time::Duration;

use puente_canopen::Frame;

use super::arbitration::key;
use super::counters::{Counters, State};
use super::{Heard, INBOX, SUSPENSION};

/// A frame that never waits for another one.
struct Babble {
    frame: Frame,
    from: u64,
    until: u64,
}

/// In which order a controller sends what it has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// As it was given.
    #[default]
    Given,
    /// The lowest identifier first, and those alike as they were given.
    Identifier,
}

/// A controller with its queues.
pub struct Seat {
    pub inbox: VecDeque<Heard>,
    pub counters: Counters,
    pub longest_wait: Duration,
    order: Order,
    outbox: Vec<(u64, Frame)>,
    babble: Option<Babble>,
    absent: bool,
    /// Not before: it lets others go first.
    suspended: u64,
}

impl Seat {
    pub fn new(order: Order) -> Self {
        Self {
            inbox: VecDeque::new(),
            counters: Counters::default(),
            longest_wait: Duration::ZERO,
            order,
            outbox: Vec::new(),
            babble: None,
            absent: false,
            suspended: 0,
        }
    }

    /// What it sends next.
    fn next(&self) -> Option<&(u64, Frame)> {
        match self.order {
            Order::Given => self.outbox.first(),
            Order::Identifier => self.outbox.iter().min_by_key(|(_, frame)| key(frame)),
        }
    }

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
            self.outbox.push((now, frame));
        }
    }

    /// Forgets what waits, but for a frame that has `begun`.
    pub fn discard(&mut self, begun: Option<Frame>) {
        self.outbox.retain(|(_, frame)| Some(*frame) == begun);
        self.outbox.truncate(1);
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
        let queued = self.outbox.iter().map(|(at, _)| *at).min();
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
            _ => self.next().map(|(_, frame)| *frame),
        }
    }

    /// A frame of it, which began at `begin`, went over the bus, which is free from `free` on; how long it waited, ns.
    pub fn sent(&mut self, frame: &Frame, begin: u64, free: u64, bit: u64) -> u64 {
        self.counters.sent();
        self.suspend(free, bit);
        if self.babbles(begin) {
            return 0;
        }
        let place = self.outbox.iter().position(|(_, queued)| queued == frame);
        let queued = place.map_or(begin, |place| self.outbox.remove(place).0);
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
