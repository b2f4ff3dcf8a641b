//! What LSS master and slaves say.

use crate::cob;
use crate::frame::{Frame, Id};

/// The states of an LSS slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Nothing but switching is listened to.
    Waiting = 0,
    /// It is configured.
    Configuration = 1,
}

/// The four values of an identity, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Vendor-ID.
    Vendor = 0,
    /// Product code.
    Product = 1,
    /// Revision number.
    Revision = 2,
    /// Serial number.
    Serial = 3,
}

impl Part {
    /// All of them, in their order.
    pub const ALL: [Self; 4] = [Self::Vendor, Self::Product, Self::Revision, Self::Serial];

    /// The part of a number, 0 to 3.
    pub const fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Vendor,
            1 => Self::Product,
            2 => Self::Revision,
            3 => Self::Serial,
            _ => return None,
        })
    }
}

/// A message of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Switch state global: 04h. Not answered.
    SwitchGlobal(Mode),
    /// Switch state selective, of four messages: 40h to 43h. The node that all four name answers to the last.
    Select(Part, u32),
    /// Configure node-ID: 11h.
    ConfigureNodeId(u8),
    /// Configure bit timing: 13h.
    ConfigureBitTiming {
        /// 0 is that of the standard.
        table: u8,
        /// Index in it.
        index: u8,
    },
    /// Activate bit timing: 15h. Not answered.
    ActivateBitTiming {
        /// Twice so long nobody sends: before and after the switch. ms.
        delay: u16,
    },
    /// Store configuration: 17h.
    Store,
    /// Fastscan: 51h. Answered by the nodes without node-ID that it fits.
    Fastscan {
        /// The value that is tried.
        id: u32,
        /// The lowest of its bits that counts; [`Request::START`] begins a scan.
        bit: u8,
        /// Number of the part that is tried.
        part: u8,
        /// Number of the part that comes next.
        next: u8,
    },
    /// Inquire identity: 5Ah to 5Dh.
    Inquire(Part),
    /// Inquire node-ID: 5Eh.
    InquireNodeId,
}

impl Request {
    /// In a fastscan, in place of a bit: the scan begins.
    pub const START: u8 = 0x80;

    /// Its frame.
    pub const fn frame(self) -> Frame {
        let (first, rest) = match self {
            Self::SwitchGlobal(mode) => (0x04, [mode as u8, 0, 0, 0, 0, 0, 0]),
            Self::Select(part, value) => (0x40 + part as u8, long(value, [0; 3])),
            Self::ConfigureNodeId(id) => (0x11, [id, 0, 0, 0, 0, 0, 0]),
            Self::ConfigureBitTiming { table, index } => (0x13, [table, index, 0, 0, 0, 0, 0]),
            Self::ActivateBitTiming { delay } => {
                let [low, high] = delay.to_le_bytes();
                (0x15, [low, high, 0, 0, 0, 0, 0])
            }
            Self::Store => (0x17, [0; 7]),
            Self::Fastscan { id, bit, part, next } => (0x51, long(id, [bit, part, next])),
            Self::Inquire(part) => (0x5A + part as u8, [0; 7]),
            Self::InquireNodeId => (0x5E, [0; 7]),
        };
        message(cob::LSS_MASTER, first, rest)
    }

    /// The request in a frame; `None` where it is none.
    pub fn parse(frame: &Frame) -> Option<Self> {
        let &[first, a, b, c, d, e, f, g] = frame.data_of(cob::LSS_MASTER)? else {
            return None;
        };
        let word = u32::from_le_bytes([a, b, c, d]);
        Some(match first {
            0x04 if a == 0 => Self::SwitchGlobal(Mode::Waiting),
            0x04 if a == 1 => Self::SwitchGlobal(Mode::Configuration),
            0x40..=0x43 => Self::Select(Part::from_number(first - 0x40)?, word),
            0x11 => Self::ConfigureNodeId(a),
            0x13 => Self::ConfigureBitTiming { table: a, index: b },
            0x15 => Self::ActivateBitTiming { delay: u16::from_le_bytes([a, b]) },
            0x17 => Self::Store,
            0x51 => Self::Fastscan { id: word, bit: e, part: f, next: g },
            0x5A..=0x5D => Self::Inquire(Part::from_number(first - 0x5A)?),
            0x5E => Self::InquireNodeId,
            _ => return None,
        })
    }
}

/// A message of a slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// It has been selected: 44h.
    Selected,
    /// What became of a configuration: 11h node-ID, 13h bit timing, 17h store.
    Configured {
        /// Command specifier: 11h, 13h or 17h.
        what: u8,
        /// 0: done; 255: see `vendor`; others: why not.
        error: u8,
        /// The manufacturer's error code.
        vendor: u8,
    },
    /// A scanned value fits: 4Fh.
    Identified,
    /// A part of its identity: 5Ah to 5Dh.
    Part(Part, u32),
    /// Its node-ID, 255 for none: 5Eh.
    NodeId(u8),
}

impl Response {
    /// Its frame.
    pub const fn frame(self) -> Frame {
        let (first, rest) = match self {
            Self::Selected => (0x44, [0; 7]),
            Self::Configured { what, error, vendor } => (what, [error, vendor, 0, 0, 0, 0, 0]),
            Self::Identified => (0x4F, [0; 7]),
            Self::Part(part, value) => (0x5A + part as u8, long(value, [0; 3])),
            Self::NodeId(id) => (0x5E, [id, 0, 0, 0, 0, 0, 0]),
        };
        message(cob::LSS_SLAVE, first, rest)
    }

    /// The response in a frame; `None` where it is none.
    pub fn parse(frame: &Frame) -> Option<Self> {
        let &[first, a, b, c, d, ..] = frame.data_of(cob::LSS_SLAVE).filter(|data| data.len() == 8)? else {
            return None;
        };
        Some(match first {
            0x44 => Self::Selected,
            0x11 | 0x13 | 0x17 => Self::Configured { what: first, error: a, vendor: b },
            0x4F => Self::Identified,
            0x5A..=0x5D => Self::Part(Part::from_number(first - 0x5A)?, u32::from_le_bytes([a, b, c, d])),
            0x5E => Self::NodeId(a),
            _ => return None,
        })
    }
}

const fn long(value: u32, [e, f, g]: [u8; 3]) -> [u8; 7] {
    let [a, b, c, d] = value.to_le_bytes();
    [a, b, c, d, e, f, g]
}

const fn message(id: u16, first: u8, [a, b, c, d, e, f, g]: [u8; 7]) -> Frame {
    Frame::full(Id::base(id), [first, a, b, c, d, e, f, g])
}
