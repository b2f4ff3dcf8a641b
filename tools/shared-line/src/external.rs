//! A station that is outside: in another thread, another program, another machine.

use std::collections::VecDeque;

use puente_line::Instant;

use crate::heard::{Drive, Heard, Node};

/// The line's end of a station outside. It says what it is given, when it is given it, and keeps what it hears. It joins with
/// [`crate::Place::judged`] off: nobody here can know what the one outside has heard yet.
///
/// [`crate::Line::run_until`] the present comes first, then [`crate::Line::tell`].
#[derive(Clone, Debug, Default)]
pub struct External {
    to_do: VecDeque<Drive>,
    heard: Vec<u8>,
}

impl External {
    /// Sends bytes, after those that are under way.
    pub fn say(&mut self, bytes: &[u8]) {
        self.to_do.push_back(Drive::Transmit(bytes.to_vec()));
    }

    /// Drops what has not been sent; the character that is under way goes on.
    pub fn discard(&mut self) {
        self.to_do.push_back(Drive::Discard);
    }

    /// What it has heard since the last call, its own bytes too. A character with a wrong start or stop bit is 00, as a
    /// serial device of Linux gives it.
    pub fn take(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.heard)
    }

    /// Whether it has heard something that was not taken yet.
    pub fn has_heard(&self) -> bool {
        !self.heard.is_empty()
    }
}

impl Node for External {
    fn hear(&mut self, _now: Instant, heard: Heard) {
        self.heard.push(match heard {
            Heard::Byte(byte) => byte,
            Heard::Damaged => 0,
        });
    }

    fn carrier(&mut self, _now: Instant) {}

    fn poll(&mut self, _now: Instant) -> Option<Drive> {
        self.to_do.pop_front()
    }

    fn poll_at(&self) -> Option<Instant> {
        (!self.to_do.is_empty()).then_some(Instant::ZERO)
    }
}
