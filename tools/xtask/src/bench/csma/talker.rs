//! Stations that do nothing but talk, and one that only listens.

use std::collections::VecDeque;
use std::time::Duration;

use puente_framed::arbiter::{Action, Config, Statistics};
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Arbiter, Decoder, Kind, Random, section};
use puente_line::Instant;
use puente_shared_line::{Drive, Heard, Node};

/// Frames that wait at a station at most; what comes when so many wait is lost.
pub const QUEUE: usize = 16;

/// Where a station's frames come from.
#[derive(Clone, Copy, Debug)]
pub enum Load {
    /// There is always another one.
    Saturated,
    /// At random times (Poisson), so long after each other on average.
    Offered(Duration),
}

pub struct Talker {
    arbiter: Arbiter<MAX_FRAME>,
    frame: Vec<u8>,
    load: Load,
    random: Random,
    next_arrival: Instant,
    /// When each waiting frame came, and first that of the one in work.
    waiting: VecDeque<Instant>,
    pub seen: Seen,
}

/// What a station has met with.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    pub sent: u64,
    /// From the arrival of a frame to its end on the line.
    pub delays: Vec<Duration>,
    /// Given up by the arbiter.
    pub failed: u64,
    /// Met a full queue.
    pub rejected: u64,
}

impl Talker {
    pub fn new(config: Config, address: u8, length: usize, load: Load, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let arbiter = Arbiter::new(config, Instant::ZERO, u64::from(random.next()) << 8 | u64::from(address));
        let mut talker = Self {
            arbiter,
            frame: frame_of(address, length),
            load,
            random,
            next_arrival: Instant::ZERO,
            waiting: VecDeque::new(),
            seen: Seen::default(),
        };
        talker.next_arrival = Instant::ZERO + talker.pause();
        talker
    }

    pub fn statistics(&self) -> Statistics {
        self.arbiter.statistics()
    }

    fn pause(&mut self) -> Duration {
        match self.load {
            Load::Saturated => Duration::ZERO,
            Load::Offered(mean) => {
                let uniform = (f64::from(self.random.next()) + 1.0) / (f64::from(u32::MAX) + 1.0);
                mean.mul_f64(-uniform.ln())
            }
        }
    }

    fn refill(&mut self, now: Instant) {
        match self.load {
            Load::Saturated if self.waiting.is_empty() => self.waiting.push_back(now),
            Load::Saturated => {}
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
            let _ = self.arbiter.submit(now, |buffer| {
                buffer.clear();
                buffer.extend_from_slice(frame)
            });
        }
    }

    fn done(&mut self, now: Instant, sent: bool) {
        let came = self.waiting.pop_front().unwrap_or(now);
        if sent {
            self.seen.sent += 1;
            self.seen.delays.push(now.since(came));
        } else {
            self.seen.failed += 1;
        }
    }
}

/// Any frame of `length` bytes.
fn frame_of(address: u8, length: usize) -> Vec<u8> {
    let mut body = heapless::Vec::<u8, MAX_FRAME>::new();
    let mut left = length - frame::OVERHEAD;
    while left > 0 {
        // No section may be left with less than its own overhead.
        let part = if left > 255 + section::OVERHEAD { 255 } else { left.min(258) };
        let data = vec![0x55; part - section::OVERHEAD];
        section::push(&mut body, 17, &data).expect("it fits");
        left -= part;
    }
    let mut frame = heapless::Vec::<u8, MAX_FRAME>::new();
    frame::emit(&mut frame, address, Kind::Plain, &body).expect("a frame");
    assert_eq!(frame.len(), length);
    frame.to_vec()
}

/// Whoever is on the line.
pub enum Station {
    Talker(Box<Talker>),
    /// Counts the frames that it understands.
    Listener {
        decoder: Box<Decoder<MAX_FRAME>>,
        silence: Duration,
        last: Instant,
        heard: u64,
    },
}

impl Station {
    pub fn listener(silence: Duration) -> Self {
        Self::Listener { decoder: Box::default(), silence, last: Instant::ZERO, heard: 0 }
    }
}

impl Node for Station {
    fn hear(&mut self, now: Instant, what: Heard) {
        match (self, what) {
            (Self::Talker(talker), Heard::Byte(byte)) => talker.arbiter.receive(now, byte),
            (Self::Talker(talker), Heard::Damaged) => talker.arbiter.line_error(now),
            (Self::Listener { decoder, silence, last, heard }, what) => {
                if now.since(*last) >= *silence {
                    decoder.silence();
                    while decoder.advance() {
                        *heard += 1;
                    }
                }
                *last = now;
                if let Heard::Byte(byte) = what {
                    decoder.push(byte);
                }
                while decoder.is_ready() && decoder.advance() {
                    *heard += 1;
                }
            }
        }
    }

    fn carrier(&mut self, now: Instant) {
        if let Self::Talker(talker) = self {
            talker.arbiter.carrier(now);
        }
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        let Self::Talker(talker) = self else {
            return None;
        };
        loop {
            talker.refill(now);
            match talker.arbiter.poll(now) {
                Action::Transmit(bytes) => return Some(Drive::Transmit(bytes.to_vec())),
                Action::Jam(bytes) => return Some(Drive::Jam(bytes.to_vec())),
                Action::Done(outcome) => talker.done(now, outcome.is_ok()),
                Action::Idle => return None,
            }
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        let Self::Talker(talker) = self else {
            return None;
        };
        let arrival = match talker.load {
            Load::Saturated if talker.waiting.is_empty() => Some(Instant::ZERO),
            Load::Saturated => None,
            Load::Offered(_) => Some(talker.next_arrival),
        };
        [talker.arbiter.poll_at(), arrival].into_iter().flatten().min()
    }
}
