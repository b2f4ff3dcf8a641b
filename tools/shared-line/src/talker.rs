//! A station that does nothing but talk.

use std::collections::VecDeque;
use std::time::Duration;

use puente_framed::arbiter::{Action, Config, Precedence, Statistics};
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Arbiter, Kind, Random, section};
use puente_line::Instant;

use crate::heard::{Drive, Heard, Node};

/// Frames that wait at a station at most; what comes when so many wait is lost.
pub const QUEUE: usize = 16;

/// Where a station's frames come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// There are none.
    Nothing,
    /// There is always another one.
    Saturated,
    /// At random times (Poisson), so long after each other on average.
    Offered(Duration),
}

/// A station that sends frames to nobody, under CSMA/CD, and counts what becomes of them.
pub struct Talker {
    arbiter: Arbiter<MAX_FRAME>,
    frame: Vec<u8>,
    load: Load,
    random: Random,
    next_arrival: Instant,
    /// When each waiting frame came, and first that of the one in work.
    waiting: VecDeque<Instant>,
    /// What it has met with.
    pub seen: Seen,
}

/// What a station has met with.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Frames that got onto the line whole.
    pub sent: u64,
    /// From the arrival of each frame to its end on the line; `None`, as at first, keeps none.
    pub delays: Option<Vec<Duration>>,
    /// Given up by the arbiter.
    pub failed: u64,
    /// Met a full queue.
    pub rejected: u64,
}

impl Talker {
    /// Sends the same frame, as [`frame_of`] makes it, again and again.
    pub fn new(config: Config, frame: Vec<u8>, load: Load, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let salt = frame.get(1).copied().unwrap_or_default();
        let arbiter = Arbiter::new(config, Instant::ZERO, u64::from(random.next()) << 8 | u64::from(salt));
        let mut talker = Self {
            arbiter,
            frame,
            load,
            random,
            next_arrival: Instant::ZERO,
            waiting: VecDeque::new(),
            seen: Seen::default(),
        };
        talker.next_arrival = Instant::ZERO + talker.pause();
        talker
    }

    /// Another load from now on; what waits is sent. [`crate::Line::tell`] must have been called.
    pub fn set_load(&mut self, now: Instant, load: Load) {
        self.load = load;
        self.next_arrival = now + self.pause();
    }

    /// What it has met on the line.
    pub fn statistics(&self) -> Statistics {
        self.arbiter.statistics()
    }

    fn pause(&mut self) -> Duration {
        match self.load {
            Load::Nothing | Load::Saturated => Duration::ZERO,
            Load::Offered(mean) => {
                let uniform = (f64::from(self.random.next()) + 1.0) / (f64::from(u32::MAX) + 1.0);
                mean.mul_f64(-uniform.ln())
            }
        }
    }

    fn refill(&mut self, now: Instant) {
        match self.load {
            Load::Saturated if self.waiting.is_empty() => self.waiting.push_back(now),
            Load::Nothing | Load::Saturated => {}
            Load::Offered(_) => {
                while self.next_arrival <= now {
                    if self.waiting.len() < QUEUE {
                        self.waiting.push_back(self.next_arrival);
                    } else {
                        self.seen.rejected += 1;
                    }
                    let pause = self.pause();
                    self.next_arrival += pause;
                }
            }
        }
        if !self.waiting.is_empty() && !self.arbiter.is_busy() {
            let frame = &self.frame;
            let _ = self.arbiter.submit(now, Precedence::Ordinary, |buffer| {
                buffer.clear();
                buffer.extend_from_slice(frame)
            });
        }
    }

    fn done(&mut self, now: Instant, sent: bool) {
        let came = self.waiting.pop_front().unwrap_or(now);
        if sent {
            self.seen.sent += 1;
            if let Some(delays) = &mut self.seen.delays {
                delays.push(now.since(came));
            }
        } else {
            self.seen.failed += 1;
        }
    }
}

/// Any frame of `length` bytes, from one station to another. It must be longer than
/// [`frame::OVERHEAD`] + [`section::OVERHEAD`].
pub fn frame_of(from: u8, to: u8, length: usize) -> Vec<u8> {
    let mut body = heapless::Vec::<u8, MAX_FRAME>::new();
    let mut left = length - frame::OVERHEAD;
    while left > 0 {
        // No section may be left with less than its own overhead.
        let part = if left > 255 + section::OVERHEAD { 255 } else { left.min(258) };
        let data = vec![0x55; part - section::OVERHEAD];
        section::push(&mut body, to, &data).expect("it fits");
        left -= part;
    }
    let mut frame = heapless::Vec::<u8, MAX_FRAME>::new();
    frame::emit(&mut frame, from, Kind::Plain, &body).expect("a frame");
    assert_eq!(frame.len(), length);
    frame.to_vec()
}

impl Node for Talker {
    fn hear(&mut self, now: Instant, heard: Heard) {
        match heard {
            Heard::Byte(byte) => self.arbiter.receive(now, byte),
            Heard::Damaged => self.arbiter.line_error(now),
        }
    }

    fn carrier(&mut self, now: Instant) {
        self.arbiter.carrier(now);
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        loop {
            self.refill(now);
            match self.arbiter.poll(now) {
                Action::Transmit(bytes) => return Some(Drive::Transmit(bytes.to_vec())),
                Action::Jam(bytes) => return Some(Drive::Jam(bytes.to_vec())),
                Action::Done(outcome) => self.done(now, outcome.is_ok()),
                Action::Idle => return None,
            }
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        let arrival = match self.load {
            Load::Saturated if self.waiting.is_empty() => Some(Instant::ZERO),
            Load::Nothing | Load::Saturated => None,
            Load::Offered(_) => Some(self.next_arrival),
        };
        [self.arbiter.poll_at(), arrival].into_iter().flatten().min()
    }
}
