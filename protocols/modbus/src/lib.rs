//! Modbus: the codecs of its three framings (RTU, ASCII, MBAP), typed PDUs, and a serial-line master.
//!
//! Sans-io: bytes and the time go in, bytes and results come out. A frame with *any* function code passes; the functions
//! 01-06, 08, 0F, 10, 11, 16, 17 and 2B/0E have types, all others are opaque.
//!
//! - [`request`], [`reply`]: typed PDUs, and which reply belongs to which request.
//! - [`rtu`], [`ascii`], [`mbap`]: frames around a PDU. [`lrc`]: the check of ASCII.
//! - [`Master`]: one transaction at a time on a half-duplex line.
//! - [`server`]: finds requests in a line's bytes, for simulated slaves.
//!
//! Sources: "MODBUS Application Protocol Specification V1.1b3" and "MODBUS over Serial Line Specification and
//! Implementation Guide V1.02"; the words are theirs, except that *unit* stands for a slave's address everywhere.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod ascii;
mod exception;
pub mod function;
mod length;
pub mod lrc;
mod master;
pub mod mbap;
pub mod reply;
pub mod request;
pub mod rtu;
pub mod server;
mod stream;
mod words;

use core::fmt;

pub use exception::Exception;
pub use master::{Action, Busy, Config, Counters, Echo, Evidence, Master, Outcome};
pub use words::Words;

/// Bytes of the longest PDU: function code and data.
pub const MAX_PDU: usize = 253;

/// A protocol data unit: function code and data.
pub type Pdu = heapless::Vec<u8, MAX_PDU>;

/// The unit address that every slave hears and none answers.
pub const BROADCAST: u8 = 0;

/// Framing of a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Binary frames, separated by silence, checked by CRC-16.
    Rtu,
    /// Hexadecimal text from `:` to CR LF, checked by LRC.
    Ascii,
}

/// A frame whose check held.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Address of the slave, 0 for broadcast.
    pub unit: u8,
    /// Function code and data.
    pub pdu: Pdu,
}

impl Frame {
    /// A place for a frame.
    pub(crate) const fn empty() -> Self {
        Self { unit: BROADCAST, pdu: Pdu::new() }
    }
}

/// Why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// Fewer bytes than a frame has, or fewer than its function code calls for.
    TooShort,
    /// More bytes than a frame may have.
    TooLong,
    /// The CRC or LRC does not hold.
    Check {
        /// The check computed over what came.
        expected: u16,
        /// The check that came.
        received: u16,
    },
    /// ASCII: neither a hexadecimal digit nor a delimiter in its place.
    NotHex {
        /// Position of the character in the frame, the `:` being 0.
        at: u16,
    },
    /// ASCII: an odd number of hexadecimal digits.
    OddDigits,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort => f.write_str("the frame is too short"),
            Self::TooLong => f.write_str("the frame is too long"),
            Self::Check { expected, received } => {
                write!(f, "the check is {received:02X}h instead of {expected:02X}h")
            }
            Self::NotHex { at } => write!(f, "character {at} is no hexadecimal digit"),
            Self::OddDigits => f.write_str("the number of hexadecimal digits is odd"),
        }
    }
}

impl core::error::Error for FrameError {}

/// `parts` joined to a PDU; empty where they do not fit one.
fn join(parts: &[&[u8]]) -> Pdu {
    let mut pdu = Pdu::new();
    for part in parts {
        if pdu.extend_from_slice(part).is_err() {
            return Pdu::new();
        }
    }
    pdu
}
