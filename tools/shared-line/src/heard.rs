//! What a line and its stations say to each other.

use puente_line::Instant;

/// What a receiver makes of the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heard {
    /// A character, at its end.
    Byte(u8),
    /// A character whose start or stop bit was wrong.
    Damaged,
}

/// What a station does to the line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Drive {
    /// Sends these bytes, after those that are under way.
    Transmit(Vec<u8>),
    /// Sends these bytes instead of those that are under way.
    Jam(Vec<u8>),
    /// Drops those of its bytes that have not begun.
    Discard,
}

/// A station on the line.
pub trait Node {
    /// A character has ended here.
    fn hear(&mut self, now: Instant, heard: Heard);

    /// A character is arriving here; said before [`Node::poll`] to one that can tell.
    fn carrier(&mut self, now: Instant);

    /// What it does now; asked again until there is nothing.
    fn poll(&mut self, now: Instant) -> Option<Drive>;

    /// When to ask again, besides after it has heard something.
    fn poll_at(&self) -> Option<Instant>;
}

impl<T: Node + ?Sized> Node for Box<T> {
    fn hear(&mut self, now: Instant, heard: Heard) {
        (**self).hear(now, heard);
    }

    fn carrier(&mut self, now: Instant) {
        (**self).carrier(now);
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        (**self).poll(now)
    }

    fn poll_at(&self) -> Option<Instant> {
        (**self).poll_at()
    }
}
