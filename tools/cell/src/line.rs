//! Time on the wire: characters take their time in both directions.

use std::collections::VecDeque;
use std::time::Duration;

use puente_line::{Instant, Settings};

use crate::log::{Event, Log};

/// Characters that may be under way to the drives; more than that are lost.
const UNDER_WAY: usize = 65_536;

/// Time that characters take; none on a line that is not paced.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    pub line: Settings,
    pub paced: bool,
}

impl Pace {
    fn time(self, characters: usize) -> Duration {
        if self.paced { self.line.wire_time(characters) } else { Duration::ZERO }
    }
}

/// Characters from the master: they come in bursts and arrive one after the other.
#[derive(Debug)]
pub(crate) struct Arrivals {
    pace: Pace,
    queue: VecDeque<(Instant, u8)>,
    /// Start of the burst and its characters so far.
    burst: (Instant, usize),
}

impl Arrivals {
    pub fn new(pace: Pace) -> Self {
        Self { pace, queue: VecDeque::new(), burst: (Instant::ZERO, 0) }
    }

    /// Takes characters that the master starts to send now, or when the line is free. Returns that moment.
    pub fn push(&mut self, now: Instant, bytes: &[u8]) -> Instant {
        let free = self.burst.0 + self.pace.time(self.burst.1);
        if now >= free {
            self.burst = (now, 0);
        }
        for byte in bytes.iter().take(UNDER_WAY.saturating_sub(self.queue.len())) {
            self.burst.1 += 1;
            self.queue.push_back((self.burst.0 + self.pace.time(self.burst.1), *byte));
        }
        free.max(now)
    }

    /// When the next character is complete.
    pub fn next_at(&self) -> Option<Instant> {
        self.queue.front().map(|(at, _)| *at)
    }

    /// When the last character is complete.
    pub fn last_at(&self) -> Option<Instant> {
        self.queue.back().map(|(at, _)| *at)
    }

    pub fn pop(&mut self) -> Option<u8> {
        self.queue.pop_front().map(|(_, byte)| byte)
    }
}

#[derive(Debug)]
struct Pending {
    due: Instant,
    bytes: Vec<u8>,
}

#[derive(Debug)]
struct Current {
    start: Instant,
    sent: usize,
    bytes: Vec<u8>,
}

/// Frames to the master, one after the other, the one that was due first before the others.
#[derive(Debug)]
pub(crate) struct Departures {
    pace: Pace,
    /// Least time between two frames.
    silence: Duration,
    pending: Vec<Pending>,
    current: Option<Current>,
    free: Instant,
}

impl Departures {
    pub fn new(pace: Pace, silence: Duration) -> Self {
        Self { pace, silence, pending: Vec::new(), current: None, free: Instant::ZERO }
    }

    /// Sends a frame at `due`, or later where the line is not free.
    pub fn send(&mut self, due: Instant, bytes: Vec<u8>) {
        let at = self.pending.partition_point(|earlier| earlier.due <= due);
        self.pending.insert(at, Pending { due, bytes });
    }

    /// The characters that are complete by now.
    pub fn poll(&mut self, now: Instant, log: &mut Log) -> Vec<u8> {
        let mut complete = Vec::new();
        while let Some(mut current) = self.current.take().or_else(|| self.next(now)) {
            let end = |sent| current.start + self.pace.time(sent);
            let sent = (current.sent..=current.bytes.len()).rev().find(|sent| end(*sent) <= now);
            let sent = sent.unwrap_or(current.sent);
            complete.extend_from_slice(&current.bytes[current.sent..sent]);
            if sent < current.bytes.len() {
                current.sent = sent;
                self.current = Some(current);
                break;
            }
            self.free = end(sent) + self.silence;
            log.push(end(sent), Event::Reply(current.bytes));
        }
        complete
    }

    /// When to poll again.
    pub fn poll_at(&self) -> Option<Instant> {
        match &self.current {
            Some(current) => Some(current.start + self.pace.time(current.sent + 1)),
            None => self.start(self.pending.first()?).into(),
        }
    }

    fn start(&self, pending: &Pending) -> Instant {
        pending.due.max(self.free)
    }

    fn next(&mut self, now: Instant) -> Option<Current> {
        let start = self.start(self.pending.first()?);
        (start <= now).then(|| Current { start, sent: 0, bytes: self.pending.remove(0).bytes })
    }
}
