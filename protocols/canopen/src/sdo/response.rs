//! What a server says.

use super::segment::{Initiate, Segment};
use super::{Abort, Malformed, addressed, command, eight, specifier};
use crate::Address;

/// A message of a server, other than a [`BlockSegment`](super::BlockSegment). Bits that the standard reserves are not looked
/// at, and 0 in what is emitted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Response {
    /// Initiate download: written, or the first segment may come (7.2.4.3.3).
    InitiateDownload {
        /// What is written.
        address: Address,
    },
    /// Download segment: it came (7.2.4.3.4).
    DownloadSegment {
        /// That of the segment.
        toggle: bool,
    },
    /// Initiate upload (7.2.4.3.6).
    InitiateUpload {
        /// What is read.
        address: Address,
        /// Its data, or that they follow.
        data: Initiate,
    },
    /// Upload segment (7.2.4.3.7).
    UploadSegment(Segment),
    /// Initiate block download: the first block may come (7.2.4.3.9).
    InitiateBlockDownload {
        /// What is written.
        address: Address,
        /// The server checks a CRC.
        crc: bool,
        /// Segments of the first block, 1 to 127.
        block: u8,
    },
    /// The end of a block has come (7.2.4.3.10).
    AcknowledgeBlock {
        /// Number of the last segment that came in order, 0 if none did. Those after it are to come again.
        last: u8,
        /// Segments of the next block, 1 to 127.
        block: u8,
    },
    /// End block download: all has come (7.2.4.3.11).
    EndBlockDownload,
    /// Initiate block upload (7.2.4.3.13).
    InitiateBlockUpload {
        /// What is read.
        address: Address,
        /// The server will give a CRC.
        crc: bool,
        /// How many bytes, where it is said.
        size: Option<u32>,
    },
    /// End block upload (7.2.4.3.15).
    EndBlockUpload {
        /// Bytes of the last segment that do not count, 0 to 7.
        unused: u8,
        /// Over all data; 0 where there is none.
        crc: u16,
    },
    /// The transfer is over (7.2.4.3.17).
    Abort {
        /// What was transferred.
        address: Address,
        /// Why.
        code: Abort,
    },
}

impl Response {
    /// Eight bytes.
    pub fn to_bytes(&self) -> [u8; 8] {
        match *self {
            Self::UploadSegment(ref segment) => segment.emit(0),
            Self::DownloadSegment { toggle } => [command(1, u8::from(toggle) << 4), 0, 0, 0, 0, 0, 0, 0],
            Self::InitiateUpload { address, ref data } => {
                let (rest, bytes) = data.emit();
                addressed(command(2, rest), address, bytes)
            }
            Self::InitiateDownload { address } => addressed(command(3, 0), address, [0; 4]),
            Self::Abort { address, code } => addressed(command(4, 0), address, code.0.to_le_bytes()),
            Self::InitiateBlockDownload { address, crc, block } => {
                addressed(command(5, u8::from(crc) << 2), address, [block, 0, 0, 0])
            }
            Self::EndBlockDownload => [command(5, 1), 0, 0, 0, 0, 0, 0, 0],
            Self::AcknowledgeBlock { last, block } => [command(5, 2), last, block, 0, 0, 0, 0, 0],
            Self::InitiateBlockUpload { address, crc, size } => {
                let rest = u8::from(crc) << 2 | u8::from(size.is_some()) << 1;
                addressed(command(6, rest), address, size.unwrap_or(0).to_le_bytes())
            }
            Self::EndBlockUpload { unused, crc } => {
                let [low, high] = crc.to_le_bytes();
                [command(6, (unused & 7) << 2 | 1), low, high, 0, 0, 0, 0, 0]
            }
        }
    }

    /// # Errors
    /// Any [`Malformed`].
    pub fn parse(data: &[u8]) -> Result<Self, Malformed> {
        let bytes = eight(data)?;
        let [first, low, high, sub, a, b, c, d] = bytes;
        let address = Address::from_bytes([low, high, sub]);
        let word = u32::from_le_bytes([a, b, c, d]);
        Ok(match (specifier(first), first & 3) {
            (0, _) => Self::UploadSegment(Segment::parse(bytes)),
            (1, _) => Self::DownloadSegment { toggle: first & 0x10 != 0 },
            (2, _) => Self::InitiateUpload { address, data: Initiate::parse(first, [a, b, c, d]) },
            (3, _) => Self::InitiateDownload { address },
            (4, _) => Self::Abort { address, code: Abort(word) },
            (5, 0) => Self::InitiateBlockDownload { address, crc: first & 4 != 0, block: a },
            (5, 1) => Self::EndBlockDownload,
            (5, 2) => Self::AcknowledgeBlock { last: low, block: high },
            (6, 0 | 2) => {
                let size = (first & 2 != 0).then_some(word);
                Self::InitiateBlockUpload { address, crc: first & 4 != 0, size }
            }
            (6, _) => Self::EndBlockUpload { unused: first >> 2 & 7, crc: u16::from_le_bytes([low, high]) },
            _ => return Err(Malformed::Command { received: first }),
        })
    }
}
