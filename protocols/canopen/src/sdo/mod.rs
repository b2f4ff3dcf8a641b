//! Service data objects: reading and writing any object of a node (7.2.4).
//!
//! An *upload* reads from the server, a *download* writes to it.
//!
//! - [`Request`], [`Response`], [`BlockSegment`]: the eight bytes of a message, for either end.
//! - [`Client`]: one transfer at a time with one server. [`Server`]: gives and takes the objects of a [`Dictionary`].
//! - [`Abort`]: why a transfer ended.

mod abort;
mod client;
mod request;
mod response;
mod segment;
mod server;

pub use abort::Abort;
pub use client::{Action, Busy, Client, Config, Counters, Failure, Outcome, Transfer};
pub use request::Request;
pub use response::Response;
pub use segment::{BlockSegment, Initiate, Segment};
pub use server::{Dictionary, Server};

/// Data bytes of a segment.
pub const SEGMENT: usize = 7;
/// Segments of the longest block.
pub const MAX_BLOCK: u8 = 127;

/// A table of 512 bytes: a byte per look-up.
static CRC: crc::Crc<u16, crc::Table<1>> = crc::Crc::<u16, crc::Table<1>>::new(&crc::CRC_16_XMODEM);

/// The CRC of a block transfer (7.2.4.3.16) over `bytes` that follow those which gave `crc`; begins with 0.
pub fn crc(crc: u16, bytes: &[u8]) -> u16 {
    let mut digest = CRC.digest_with_initial(crc);
    digest.update(bytes);
    digest.finalize()
}

/// Why eight bytes are no message of their sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Malformed {
    /// Not eight bytes.
    Length {
        /// How many came.
        received: u8,
    },
    /// The command specifier is reserved.
    Command {
        /// The first byte.
        received: u8,
    },
}

/// The command specifier: the highest three bits of the first byte.
const fn specifier(byte: u8) -> u8 {
    byte >> 5
}

/// First byte of a message with a command specifier and the five bits below it.
const fn command(specifier: u8, rest: u8) -> u8 {
    specifier << 5 | rest
}

/// A message of `first`, what an object's address takes, and four bytes.
const fn addressed(first: u8, address: crate::Address, rest: [u8; 4]) -> [u8; 8] {
    let [low, high, sub] = address.to_bytes();
    let [a, b, c, d] = rest;
    [first, low, high, sub, a, b, c, d]
}

/// The eight bytes of a message.
fn eight(data: &[u8]) -> Result<[u8; 8], Malformed> {
    data.try_into().map_err(|_| Malformed::Length { received: data.len() as u8 })
}
