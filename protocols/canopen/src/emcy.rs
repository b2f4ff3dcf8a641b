//! Emergency messages (7.2.7), and what a node has sent of them.

use core::fmt;

use heapless::HistoryBuf;
use puente_line::Instant;

use crate::cob::{Function, NodeId};
use crate::frame::{Frame, Id};

/// An emergency message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code, see [`describe`]; 0 says that an error is over.
    pub code: u16,
    /// Error register (1001h), see [`Register`].
    pub register: u8,
    /// The manufacturer's.
    pub vendor: [u8; 5],
}

impl Emergency {
    /// The error code of "error reset or no error".
    pub const RESET: u16 = 0;

    /// Eight bytes.
    pub const fn to_bytes(self) -> [u8; 8] {
        let [low, high] = self.code.to_le_bytes();
        let [a, b, c, d, e] = self.vendor;
        [low, high, self.register, a, b, c, d, e]
    }

    /// See [`Emergency::to_bytes`].
    pub const fn from_bytes([low, high, register, a, b, c, d, e]: [u8; 8]) -> Self {
        Self { code: u16::from_le_bytes([low, high]), register, vendor: [a, b, c, d, e] }
    }

    /// Its frame, with the COB-ID as delivered.
    pub fn frame(self, node: NodeId) -> Frame {
        Frame::full(Id::Base(node.emcy()), self.to_bytes())
    }

    /// The emergency in a frame with a COB-ID as delivered, and whose it is; `None` where it is none. Fewer than eight bytes,
    /// which some devices send, are filled with zeros; fewer than three are none.
    pub fn parse(frame: &Frame) -> Option<(NodeId, Self)> {
        let Function::Emcy(node) = Function::of(frame.id())? else {
            return None;
        };
        let data = frame.data();
        if data.len() < 3 {
            return None;
        }
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some((node, Self::from_bytes(bytes)))
    }
}

impl fmt::Display for Emergency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h {}", self.code, describe(self.code))
    }
}

/// The error register (1001h, 7.5.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Register(pub u8);

impl Register {
    const NAMES: [(u8, &'static str); 7] = [
        (0x01, "generic"),
        (0x02, "current"),
        (0x04, "voltage"),
        (0x08, "temperature"),
        (0x10, "communication"),
        (0x20, "device profile"),
        (0x80, "manufacturer"),
    ];

    /// The names of the bits that are set; bit 6 is reserved.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(bit, _)| self.0 & bit != 0).map(|(_, name)| name)
    }
}

/// What an error code is about, by the classes of 7.2.7.1 and, where they have one, by their detail.
pub const fn describe(code: u16) -> &'static str {
    match code {
        0x8110 => "CAN overrun",
        0x8120 => "CAN error passive",
        0x8130 => "guarding or heartbeat missing",
        0x8140 => "recovered from bus off",
        0x8150 => "CAN-ID collision",
        0x8210 => "PDO not processed: length",
        0x8220 => "PDO longer than mapped",
        0x8230 => "destination MPDO not processed",
        0x8240 => "SYNC of a wrong length",
        0x8250 => "receive PDO missing",
        _ => match code >> 8 {
            0x00 => "no error",
            0x10 => "generic error",
            0x20 => "current",
            0x21 => "current, input side",
            0x22 => "current inside",
            0x23 => "current, output side",
            0x30 => "voltage",
            0x31 => "mains voltage",
            0x32 => "voltage inside",
            0x33 => "output voltage",
            0x40 => "temperature",
            0x41 => "ambient temperature",
            0x42 => "device temperature",
            0x50 => "hardware",
            0x60 => "software",
            0x61 => "internal software",
            0x62 => "user software",
            0x63 => "data set",
            0x70 => "additional modules",
            0x80 => "monitoring",
            0x81 => "communication",
            0x82 => "protocol error",
            0x90 => "external error",
            0xF0 => "additional functions",
            0xFF => "device specific",
            class => match class >> 4 {
                0x1 => "generic error",
                0x2 => "current",
                0x3 => "voltage",
                0x4 => "temperature",
                0x5 => "hardware",
                0x6 => "software",
                0x7 => "additional modules",
                0x8 => "monitoring",
                0x9 => "external error",
                0xF => "additional functions",
                _ => "reserved",
            },
        },
    }
}

/// The last `N` emergencies of a node, and whether one is pending.
#[derive(Clone, Debug, Default)]
pub struct History<const N: usize> {
    entries: HistoryBuf<(Instant, Emergency), N>,
    pending: Option<Emergency>,
    count: u32,
}

impl<const N: usize> History<N> {
    /// An empty one.
    pub const fn new() -> Self {
        Self { entries: HistoryBuf::new(), pending: None, count: 0 }
    }

    /// Takes note. The state machine of 7.2.7: an error is pending until an error reset without any bit of the register left;
    /// what a reset leaves over is not said, so that the last error stays.
    pub fn push(&mut self, now: Instant, emergency: Emergency) {
        self.count = self.count.wrapping_add(1);
        if emergency.code != Emergency::RESET {
            self.pending = Some(emergency);
        } else if emergency.register == 0 {
            self.pending = None;
        }
        self.entries.write((now, emergency));
    }

    /// The node has booted: nothing is pending any more.
    pub const fn boot(&mut self) {
        self.pending = None;
    }

    /// The last error that is not over.
    pub const fn pending(&self) -> Option<Emergency> {
        self.pending
    }

    /// The last `N`, the newest last; resets are among them.
    pub fn entries(&self) -> impl Iterator<Item = &(Instant, Emergency)> {
        self.entries.oldest_ordered()
    }

    /// All that ever came, modulo 2^32.
    pub const fn count(&self) -> u32 {
        self.count
    }
}
