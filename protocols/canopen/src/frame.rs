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

/// Counts bits, with those that are stuffed in after five alike, and takes the CRC of those pushed. Every frame of a busy
/// bus is counted, so it goes by four bits at a time.
struct Stuffed {
    count: u32,
    run: Run,
    crc: u16,
}

impl Stuffed {
    const fn new() -> Self {
        Self { count: 0, run: Run::NONE, crc: 0 }
    }

    /// The lowest `count` bits of `value`, the highest first.
    fn push(&mut self, value: u32, count: u32) {
        self.count += count;
        let fours = count / 4;
        for at in (4 * fours..count).rev() {
            let bit = (value >> at & 1) as u8;
            self.crc = crc15(self.crc, bit);
            self.follow(self.run.then(bit));
        }
        for at in (0..fours).rev() {
            let four = value >> (4 * at) & 15;
            self.crc = self.crc << 4 & 0x7FFF ^ CRC_OF_FOUR[usize::from(self.crc >> 11) ^ four as usize];
            self.follow(RUN_AFTER_FOUR[usize::from(self.run.0)][four as usize]);
        }
    }

    const fn follow(&mut self, (run, stuffed): (Run, u8)) {
        self.run = run;
        self.count += stuffed as u32;
    }
}

/// How many bits were alike at last, 0 to 4, and five more where they were ones.
#[derive(Clone, Copy)]
struct Run(u8);

impl Run {
    /// Of nothing yet.
    const NONE: Self = Self(0);
    const COUNT: usize = 10;

    /// After another bit, and how many were stuffed in: after five alike one that is not.
    const fn then(self, bit: u8) -> (Self, u8) {
        let alike = if self.0 / 5 == bit { self.0 % 5 + 1 } else { 1 };
        if alike == 5 { (Self(5 * (1 - bit) + 1), 1) } else { (Self(5 * bit + alike), 0) }
    }

    /// After another four bits.
    const fn then_four(self, four: u8) -> (Self, u8) {
        let (mut run, mut all, mut at) = (self, 0, 4);
        while at > 0 {
            at -= 1;
            let (after, stuffed) = run.then(four >> at & 1);
            (run, all) = (after, all + stuffed);
        }
        (run, all)
    }
}

const RUN_AFTER_FOUR: [[(Run, u8); 16]; Run::COUNT] = {
    let mut table = [[(Run::NONE, 0); 16]; Run::COUNT];
    let mut at = 0;
    while at < 16 * Run::COUNT {
        table[at / 16][at % 16] = Run(at as u8 / 16).then_four(at as u8 % 16);
        at += 1;
    }
    table
};

/// What the CRC is after four bits that differ so from its first four, and zeros else.
const CRC_OF_FOUR: [u16; 16] = {
    let mut table = [0; 16];
    let mut four = 0;
    while four < 16 {
        let mut at = 4;
        while at > 0 {
            at -= 1;
            table[four] = crc15(table[four], (four >> at & 1) as u8);
        }
        four += 1;
    }
    table
};

const fn crc15(crc: u16, bit: u8) -> u16 {
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

    proptest::proptest! {
        #[test]
        fn four_at_a_time_are_as_one_at_a_time(pieces in proptest::collection::vec((0..u32::MAX, 0..19u32), 0..20)) {
            let (mut fours, mut ones) = (Stuffed::new(), Stuffed::new());
            for (value, count) in pieces {
                fours.push(value, count);
                (0..count).rev().for_each(|at| ones.push(value >> at, 1));
                assert_eq!((fours.count, fours.crc, fours.run.0), (ones.count, ones.crc, ones.run.0));
            }
        }
    }
}
