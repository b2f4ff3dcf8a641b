//! What requests and responses have in common: how data lie in them.

use heapless::Vec;

use super::{Malformed, SEGMENT, eight};

/// What an initiated transfer begins with, in the request of a download or the response of an upload (7.2.4.3.3,
/// 7.2.4.3.6).
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Initiate {
    /// All the data, 1 to 4 bytes. Emitted with none it is one byte, 0: there is no way to say none.
    Expedited(Vec<u8, 4>),
    /// All the data, and nothing says how many of these bytes they are.
    Unsized([u8; 4]),
    /// The data follow in segments.
    Segmented {
        /// How many bytes, where it is said.
        size: Option<u32>,
    },
}

impl Initiate {
    const EXPEDITED: u8 = 2;
    const SIZE: u8 = 1;

    /// The low five bits of the first byte, and the data field.
    pub(super) fn emit(&self) -> (u8, [u8; 4]) {
        match self {
            Self::Expedited(data) => {
                let (bytes, length) = padded(data);
                let unused = 4 - length.max(1);
                (unused << 2 | Self::EXPEDITED | Self::SIZE, bytes)
            }
            Self::Unsized(bytes) => (Self::EXPEDITED, *bytes),
            Self::Segmented { size: Some(size) } => (Self::SIZE, size.to_le_bytes()),
            Self::Segmented { size: None } => (0, [0; 4]),
        }
    }

    pub(super) fn parse(first: u8, bytes: [u8; 4]) -> Self {
        let sized = first & Self::SIZE != 0;
        if first & Self::EXPEDITED == 0 {
            Self::Segmented { size: sized.then_some(u32::from_le_bytes(bytes)) }
        } else if sized {
            Self::Expedited(trimmed(bytes, first >> 2 & 3))
        } else {
            Self::Unsized(bytes)
        }
    }
}

/// A segment of a transfer whose segments are confirmed one by one (7.2.4.3.4, 7.2.4.3.7).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segment {
    /// False in the first segment, and the other from segment to segment.
    pub toggle: bool,
    /// No more segments follow.
    pub last: bool,
    /// 0 to 7 bytes.
    pub data: Vec<u8, SEGMENT>,
}

impl Segment {
    /// The message with a command specifier.
    pub(super) fn emit(&self, specifier: u8) -> [u8; 8] {
        let ([a, b, c, d, e, f, g], length) = padded(&self.data);
        let unused = SEGMENT as u8 - length;
        let rest = u8::from(self.toggle) << 4 | unused << 1 | u8::from(self.last);
        [super::command(specifier, rest), a, b, c, d, e, f, g]
    }

    pub(super) fn parse([first, data @ ..]: [u8; 8]) -> Self {
        Self { toggle: first & 0x10 != 0, last: first & 1 != 0, data: trimmed(data, first >> 1 & 7) }
    }
}

/// A segment of a block (7.2.4.3.10, 7.2.4.3.14). Nothing but the state of the transfer tells it from other messages; the
/// number 0, which none has, is that of an abort.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockSegment {
    /// Its number in the block, 1 to 127.
    pub number: u8,
    /// No more segments follow in the whole transfer.
    pub last: bool,
    /// Seven bytes; how many of the last segment's count is said at the end of the transfer.
    pub data: [u8; SEGMENT],
}

impl BlockSegment {
    const LAST: u8 = 0x80;

    /// Eight bytes.
    pub const fn to_bytes(self) -> [u8; 8] {
        let [a, b, c, d, e, f, g] = self.data;
        let last = if self.last { Self::LAST } else { 0 };
        [self.number & !Self::LAST | last, a, b, c, d, e, f, g]
    }

    /// # Errors
    /// Any [`Malformed`]: number 0 is a reserved command.
    pub fn parse(data: &[u8]) -> Result<Self, Malformed> {
        let [first, data @ ..] = eight(data)?;
        let number = first & !Self::LAST;
        if number == 0 {
            return Err(Malformed::Command { received: first });
        }
        Ok(Self { number, last: first & Self::LAST != 0, data })
    }
}

/// The first bytes of `data`, with zeros after them, and how many they are.
pub(super) fn padded<const N: usize>(data: &[u8]) -> ([u8; N], u8) {
    let mut bytes = [0; N];
    let length = bytes.iter_mut().zip(data).map(|(to, from)| *to = *from).count();
    (bytes, length as u8)
}

/// `bytes` without the last `unused`.
fn trimmed<const N: usize>(bytes: [u8; N], unused: u8) -> Vec<u8, N> {
    let mut data = Vec::from_array(bytes);
    data.truncate(N.saturating_sub(usize::from(unused)));
    data
}
