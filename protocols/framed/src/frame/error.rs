//! What can be wrong with a frame.

use core::fmt;

use crate::section::NoRoom;

/// Why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// Fewer or more bytes than its length says.
    Size,
    /// The first byte is not 7E.
    Preamble {
        /// The first byte.
        received: u8,
    },
    /// The tag is reserved.
    Tag {
        /// The tag.
        received: u8,
    },
    /// A packet of the tag cannot have this length.
    Length {
        /// The length.
        received: u16,
    },
    /// The last byte is not 0A.
    Terminator {
        /// The last byte.
        received: u8,
    },
    /// The LRC does not hold.
    Lrc {
        /// The LRC of what came.
        expected: u8,
        /// The LRC that came.
        received: u8,
    },
    /// The packet does not consist of sections.
    Sections,
    /// A tagged frame has no trailer, one of the thesis has, or what it says is reserved.
    Trailer,
    /// The CRC does not hold.
    Crc {
        /// The CRC of what came.
        expected: u32,
        /// The CRC that came.
        received: u32,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size => f.write_str("the frame is not as long as its length says"),
            Self::Preamble { received } => write!(f, "the frame begins with {received:02X}h instead of 7Eh"),
            Self::Tag { received } => write!(f, "tag {received} is reserved"),
            Self::Length { received } => write!(f, "the packet cannot be {received} bytes long"),
            Self::Terminator { received } => write!(f, "the frame ends with {received:02X}h instead of 0Ah"),
            Self::Lrc { expected, received } => {
                write!(f, "the LRC is {received:02X}h instead of {expected:02X}h")
            }
            Self::Sections => f.write_str("the packet does not consist of sections"),
            Self::Trailer => f.write_str("the trailer is missing, out of place or reserved"),
            Self::Crc { expected, received } => {
                write!(f, "the CRC is {received:08X}h instead of {expected:08X}h")
            }
        }
    }
}

impl core::error::Error for FrameError {}

/// Why a frame cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmitError {
    /// It does not fit its buffer, or its packet is longer than [`super::MAX_PACKET`].
    TooLong,
    /// Its body is not one or more sections, or ends with what would be taken for a trailer.
    Sections,
}

impl fmt::Display for EmitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the frame is too long",
            Self::Sections => "the body does not consist of sections",
        })
    }
}

impl core::error::Error for EmitError {}

impl From<NoRoom> for EmitError {
    fn from(_: NoRoom) -> Self {
        Self::TooLong
    }
}
