//! What a client says.

use super::segment::{Initiate, Segment};
use super::{Abort, Malformed, addressed, command, eight, specifier};
use crate::Address;

/// A message of a client, other than a [`BlockSegment`](super::BlockSegment). Bits that the standard reserves are not looked
/// at, and 0 in what is emitted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// Initiate download (7.2.4.3.3).
    InitiateDownload {
        /// What is written.
        address: Address,
        /// Its data, or that they follow.
        data: Initiate,
    },
    /// Download segment (7.2.4.3.4).
    DownloadSegment(Segment),
    /// Initiate upload (7.2.4.3.6).
    InitiateUpload {
        /// What is read.
        address: Address,
    },
    /// Upload segment: asks for one (7.2.4.3.7).
    UploadSegment {
        /// False in the first request, and the other from request to request.
        toggle: bool,
    },
    /// Initiate block download (7.2.4.3.9).
    InitiateBlockDownload {
        /// What is written.
        address: Address,
        /// The client will give a CRC.
        crc: bool,
        /// How many bytes, where it is said.
        size: Option<u32>,
    },
    /// End block download (7.2.4.3.11).
    EndBlockDownload {
        /// Bytes of the last segment that do not count, 0 to 7.
        unused: u8,
        /// Over all data; 0 where there is none.
        crc: u16,
    },
    /// Initiate block upload (7.2.4.3.13).
    InitiateBlockUpload {
        /// What is read.
        address: Address,
        /// The client can check a CRC.
        crc: bool,
        /// Segments of a block, 1 to 127.
        block: u8,
        /// Data of at most so many bytes may come by a plain upload; 0: they may not.
        threshold: u8,
    },
    /// Start upload: the first block may come (7.2.4.3.13).
    StartBlockUpload,
    /// The end of a block has come (7.2.4.3.14).
    AcknowledgeBlock {
        /// Number of the last segment that came in order, 0 if none did. Those after it are to come again.
        last: u8,
        /// Segments of the next block, 1 to 127.
        block: u8,
    },
    /// End block upload: all has come (7.2.4.3.15).
    EndBlockUpload,
    /// The transfer is over (7.2.4.3.17).
    Abort {
        /// What was transferred.
        address: Address,
        /// Why.
        code: Abort,
    },
}

impl Request {
    /// Eight bytes.
    pub fn to_bytes(&self) -> [u8; 8] {
        match *self {
            Self::DownloadSegment(ref segment) => segment.emit(0),
            Self::InitiateDownload { address, ref data } => {
                let (rest, bytes) = data.emit();
                addressed(command(1, rest), address, bytes)
            }
            Self::InitiateUpload { address } => addressed(command(2, 0), address, [0; 4]),
            Self::UploadSegment { toggle } => [command(3, u8::from(toggle) << 4), 0, 0, 0, 0, 0, 0, 0],
            Self::Abort { address, code } => addressed(command(4, 0), address, code.0.to_le_bytes()),
            Self::InitiateBlockUpload { address, crc, block, threshold } => {
                addressed(command(5, u8::from(crc) << 2), address, [block, threshold, 0, 0])
            }
            Self::EndBlockUpload => [command(5, 1), 0, 0, 0, 0, 0, 0, 0],
            Self::AcknowledgeBlock { last, block } => [command(5, 2), last, block, 0, 0, 0, 0, 0],
            Self::StartBlockUpload => [command(5, 3), 0, 0, 0, 0, 0, 0, 0],
            Self::InitiateBlockDownload { address, crc, size } => {
                let rest = u8::from(crc) << 2 | u8::from(size.is_some()) << 1;
                addressed(command(6, rest), address, size.unwrap_or(0).to_le_bytes())
            }
            Self::EndBlockDownload { unused, crc } => {
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
            (0, _) => Self::DownloadSegment(Segment::parse(bytes)),
            (1, _) => Self::InitiateDownload { address, data: Initiate::parse(first, [a, b, c, d]) },
            (2, _) => Self::InitiateUpload { address },
            (3, _) => Self::UploadSegment { toggle: first & 0x10 != 0 },
            (4, _) => Self::Abort { address, code: Abort(word) },
            (5, 0) => Self::InitiateBlockUpload { address, crc: first & 4 != 0, block: a, threshold: b },
            (5, 1) => Self::EndBlockUpload,
            (5, 2) => Self::AcknowledgeBlock { last: low, block: high },
            (5, _) => Self::StartBlockUpload,
            (6, 0 | 2) => {
                let size = (first & 2 != 0).then_some(word);
                Self::InitiateBlockDownload { address, crc: first & 4 != 0, size }
            }
            (6, _) => Self::EndBlockDownload { unused: first >> 2 & 7, crc: u16::from_le_bytes([low, high]) },
            _ => return Err(Malformed::Command { received: first }),
        })
    }
}
