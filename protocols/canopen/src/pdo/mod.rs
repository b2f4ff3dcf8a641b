//! Process data objects: what is in them, and how a node is told so (7.2.2, 7.5.2.35 and after).
//!
//! - [`CobId`], [`Transmission`], [`Mapped`]: the entries of the parameters.
//! - [`Setup`]: the writes that set a PDO up, in the order that nodes insist on. [`Reader`]: the reads that tell how one is
//!   set up.
//! - [`values`], [`put`]: the values in a PDO's data.

mod data;
mod parameter;
mod reader;
mod setup;

pub use data::{bytes, put, value, values};
pub use parameter::{CobId, Mapped, Reserved, Transmission};
pub use reader::{BadAnswer, Layout, Reader};
pub use setup::{BadSetup, Setup, Write};

use crate::Address;

/// Highest number of a PDO.
pub const MAX_NUMBER: u16 = 512;
/// Most objects that can be mapped to a PDO.
pub const MAX_MAPPED: usize = 64;

/// From the node's point of view, as everywhere in CANopen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The node receives it.
    Receive,
    /// The node transmits it.
    Transmit,
}

/// A PDO of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pdo {
    direction: Direction,
    number: u16,
}

impl Pdo {
    /// PDO `number`, 1 to [`MAX_NUMBER`]; `None` for others.
    pub const fn new(direction: Direction, number: u16) -> Option<Self> {
        match number {
            1..=MAX_NUMBER => Some(Self { direction, number }),
            _ => None,
        }
    }

    /// Which way it goes.
    pub const fn direction(self) -> Direction {
        self.direction
    }

    /// Its number, 1 to [`MAX_NUMBER`].
    pub const fn number(self) -> u16 {
        self.number
    }

    /// A value of its communication parameter (1400h and after, 1800h and after).
    pub const fn communication(self, sub: u8) -> Address {
        let first = match self.direction {
            Direction::Receive => 0x1400,
            Direction::Transmit => 0x1800,
        };
        Address::new(first + self.number - 1, sub)
    }

    /// A value of its mapping parameter (1600h and after, 1A00h and after).
    pub const fn mapping(self, sub: u8) -> Address {
        let Address { index, sub } = self.communication(sub);
        Address::new(index + 0x200, sub)
    }
}

/// Sub-indexes of a communication parameter.
mod sub {
    pub const COB_ID: u8 = 1;
    pub const TRANSMISSION: u8 = 2;
    pub const INHIBIT: u8 = 3;
    pub const EVENT_TIMER: u8 = 5;
    pub const SYNC_START: u8 = 6;
}
