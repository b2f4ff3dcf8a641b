//! What a board knows of itself, and a host leaves to its operating system.

use crate::port::Stack;
use crate::port::record::History;

/// Why the board runs, and what it remembers; nothing on a host.
pub fn history() -> Option<History> {
    None
}

/// An axis may move from now on, or does no more: nobody keeps it here.
pub fn may_move(_axis: u8, _moves: bool) {}

/// How much of the stack is used: not known here, and there is more.
pub fn stack() -> Option<Stack> {
    None
}

/// Temperature of the chip in degrees Celsius, where it has a sensor.
pub fn temperature() -> Option<i16> {
    None
}
