//! Whoever is on the line: stations that do nothing but talk, and one that only listens.

use std::time::Duration;

use puente_framed::Decoder;
use puente_framed::frame::MAX_FRAME;
use puente_line::Instant;
use puente_shared_line::talker::Talker;
use puente_shared_line::{Drive, Heard, Node};

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
        let (decoder, silence, last, heard) = match self {
            Self::Talker(talker) => return talker.hear(now, what),
            Self::Listener { decoder, silence, last, heard } => (decoder, silence, last, heard),
        };
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

    fn carrier(&mut self, now: Instant) {
        if let Self::Talker(talker) = self {
            talker.carrier(now);
        }
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        match self {
            Self::Talker(talker) => talker.poll(now),
            Self::Listener { .. } => None,
        }
    }

    fn poll_at(&self) -> Option<Instant> {
        match self {
            Self::Talker(talker) => talker.poll_at(),
            Self::Listener { .. } => None,
        }
    }
}
