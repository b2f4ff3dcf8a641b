//! CAN frames, and how long they are on the wire.

/// Highest base identifier.
pub const MAX_BASE: u16 = 0x7FF;
/// Highest extended identifier.
pub const MAX_EXTENDED: u32 = 0x1FFF_FFFF;
/// Data bytes of the longest frame.
pub const MAX_DATA: usize = 8;

/// Identifier of a frame; base identifiers come before extended ones of the same first 11 bits on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Id {
    /// 11 bits, 0 to [`MAX_BASE`].
    Base(u16),
    /// 29 bits, 0 to [`MAX_EXTENDED`].
    Extended(u32),
}

impl Id {
    /// A base identifier; the bits above 11 are dropped.
    pub const fn base(id: u16) -> Self {
        Self::Base(id & MAX_BASE)
    }

    /// An extended identifier; the bits above 29 are dropped.
    pub const fn extended(id: u32) -> Self {
        Self::Extended(id & MAX_EXTENDED)
    }

    /// Its number.
    pub const fn raw(self) -> u32 {
        match self {
            Self::Base(id) => id as u32,
            Self::Extended(id) => id,
        }
    }
}

/// A classical CAN frame (ISO 11898-1): data, or the request for data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    id: Id,
    remote: bool,
    /// 0 to 8. Bytes from here on are 0.
    length: u8,
    bytes: [u8; MAX_DATA],
}

impl Frame {
    /// A data frame; `None` for more than 8 bytes.
    pub fn new(id: Id, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; MAX_DATA];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self { id, remote: false, length: data.len() as u8, bytes })
    }

    /// A data frame of 8 bytes.
    pub const fn full(id: Id, bytes: [u8; MAX_DATA]) -> Self {
        Self { id, remote: false, length: MAX_DATA as u8, bytes }
    }

    /// A data frame of as many bytes as `N`, of which more than 8 are dropped.
    pub(crate) const fn of<const N: usize>(id: Id, data: [u8; N]) -> Self {
        const { assert!(N <= MAX_DATA) };
        let mut bytes = [0; MAX_DATA];
        let (head, _) = bytes.split_at_mut(N);
        head.copy_from_slice(&data);
        Self { id, remote: false, length: N as u8, bytes }
    }

    /// A remote frame: asks for a data frame of `length` bytes, at most 8.
    pub const fn remote(id: Id, length: u8) -> Self {
        let length = if length > MAX_DATA as u8 { MAX_DATA as u8 } else { length };
        Self { id, remote: true, length, bytes: [0; MAX_DATA] }
    }

    /// Its identifier.
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Whether it asks for data instead of having them.
    pub const fn is_remote(&self) -> bool {
        self.remote
    }

    /// Its data length code, 0 to 8; of a remote frame the one that is asked for.
    pub const fn length(&self) -> u8 {
        self.length
    }

    /// Its data; empty for a remote frame.
    pub fn data(&self) -> &[u8] {
        if self.remote { &[] } else { self.bytes.get(..usize::from(self.length)).unwrap_or_default() }
    }

    /// The data of a data frame with base identifier `id`.
    pub(crate) fn data_of(&self, id: u16) -> Option<&[u8]> {
        (self.id == Id::Base(id) && !self.remote).then(|| self.data())
    }

    /// Bits that the frame takes on the bus, with its stuff bits and the intermission of three bits after it.
    pub fn bits(&self) -> u32 {
        let mut stuffed = Stuffed::new();
        match self.id {
            Id::Base(id) => {
                // Start of frame; identifier; RTR; IDE and reserved.
                stuffed.push(0, 1);
                stuffed.push(u32::from(id), 11);
                stuffed.push(u32::from(self.remote), 1);
                stuffed.push(0, 2);
            }
            Id::Extended(id) => {
                // SRR and IDE stand between the two parts of the identifier; RTR and two reserved bits follow.
                stuffed.push(0, 1);
                stuffed.push(id >> 18, 11);
                stuffed.push(0b11, 2);
                stuffed.push(id, 18);
                stuffed.push(u32::from(self.remote), 1);
                stuffed.push(0, 2);
            }
        }
        stuffed.push(u32::from(self.length), 4);
        for byte in self.data() {
            stuffed.push(u32::from(*byte), 8);
        }
        stuffed.push(u32::from(stuffed.crc), 15);
        stuffed.count + UNSTUFFED
    }

    /// The most bits that any frame of this kind and length takes, as in [`Frame::bits`].
    pub const fn worst_bits(extended: bool, data_bytes: u8) -> u32 {
        let stuffable = if extended { 54 } else { 34 } + 8 * data_bytes as u32;
        stuffable + (stuffable - 1) / 4 + UNSTUFFED
    }
}

/// CRC delimiter, acknowledgement and its delimiter, end of frame, intermission: never stuffed.
const UNSTUFFED: u32 = 1 + 2 + 7 + 3;

/// Counts bits, with those that are stuffed in after five alike, and takes the CRC of those pushed.
struct Stuffed {
    count: u32,
    last: u32,
    alike: u32,
    crc: u16,
}

impl Stuffed {
    const fn new() -> Self {
        Self { count: 0, last: 2, alike: 0, crc: 0 }
    }

    /// The lowest `count` bits of `value`, the highest first.
    fn push(&mut self, value: u32, count: u32) {
        for at in (0..count).rev() {
            let bit = value >> at & 1;
            self.crc = crc15(self.crc, bit);
            self.count += 1;
            self.alike = if bit == self.last { self.alike + 1 } else { 1 };
            self.last = bit;
            if self.alike == 5 {
                self.count += 1;
                self.last = 1 - bit;
                self.alike = 1;
            }
        }
    }
}

const fn crc15(crc: u16, bit: u32) -> u16 {
    let feed = crc >> 14 & 1 ^ bit as u16;
    let shifted = crc << 1 & 0x7FFF;
    if feed == 1 { shifted ^ 0x4599 } else { shifted }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value of the catalogue for CRC-15/CAN.
    #[test]
    fn the_crc_is_that_of_can() {
        let mut bits = Stuffed::new();
        for byte in b"123456789" {
            bits.push(u32::from(*byte), 8);
        }
        assert_eq!(bits.crc, 0x059E);
    }

    #[test]
    fn five_alike_are_followed_by_another() {
        let mut bits = Stuffed::new();
        bits.push(0, 11);
        // 00000 1 00000 1 0
        assert_eq!(bits.count, 13);
        let mut bits = Stuffed::new();
        // 11111 0 0000 1: the stuff bit counts as the first of the zeros.
        bits.push(0b1_1111_0000, 9);
        assert_eq!(bits.count, 11);
    }
}
