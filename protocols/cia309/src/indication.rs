//! What a client is told unasked, a line each: no reply, so no `[` before it.

use core::fmt;

use puente_canopen::emcy::Emergency;
use puente_canopen::{NodeId, nmt};

use crate::Error;
use crate::tokens::is;

/// Which of them; ours, CANopenNode has none and lely sends all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kinds(u8);

impl Kinds {
    /// None of them.
    pub const NONE: Self = Self(0);
    /// Boot-up messages.
    pub const BOOT_UP: Self = Self(1);
    /// Emergency messages.
    pub const EMCY: Self = Self(1 << 1);
    /// Nodes and their states, as heartbeat and guarding tell them.
    pub const HEARTBEAT: Self = Self(1 << 2);
    /// Transmit PDOs as delivered, 1 to 4 of each node.
    pub const PDO: Self = Self(1 << 3);
    /// SYNC messages.
    pub const SYNC: Self = Self(1 << 4);
    /// The state of the CAN controller, and frames that were lost.
    pub const BUS: Self = Self(1 << 5);
    /// All of them.
    pub const ALL: Self = Self(0x3F);

    const NAMES: [(&'static str, Self); 7] = [
        ("boot_up", Self::BOOT_UP),
        ("emcy", Self::EMCY),
        ("heartbeat", Self::HEARTBEAT),
        ("pdo", Self::PDO),
        ("sync", Self::SYNC),
        ("bus", Self::BUS),
        ("all", Self::ALL),
    ];

    pub(crate) fn parse(word: &[u8]) -> Option<Self> {
        Self::NAMES.iter().find(|(name, _)| is(word, name)).map(|(_, kinds)| *kinds)
    }

    /// These switched on or off, the others as they are.
    pub const fn with(self, kinds: Self, on: bool) -> Self {
        if on { Self(self.0 | kinds.0) } else { Self(self.0 & !kinds.0) }
    }

    /// Whether any of those is among these.
    pub const fn has(self, kinds: Self) -> bool {
        self.0 & kinds.0 != 0
    }

    /// Whether there are none.
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }
}

/// Something that a client is told unasked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Indication<'d> {
    /// Number of the network.
    pub net: u16,
    /// What it is.
    pub what: What<'d>,
}

/// What it is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What<'d> {
    /// `1 5 BOOT_UP`, as lely.
    BootUp(NodeId),
    /// `1 5 EMCY 8130 11 0 0 0 0 0`, as lely: error code and error register in hex, the manufacturer's bytes decimal.
    Emergency(NodeId, Emergency),
    /// `1 5 ERROR 203 #Heartbeat lost.`, as lely but for the comment. With node 0 it is of the network, ours.
    Error(Option<NodeId>, Error),
    /// `1 5 STATE operational`, ours.
    State(NodeId, nmt::State),
    /// `1 5 DUPLICATE`: two nodes have this node-ID, ours.
    Duplicate(NodeId),
    /// `1 2 PDO 1 37 06`, ours: the number of the transmit PDO, and its bytes. lely's `1 pdo` has mapped values, for it knows
    /// them from a configuration.
    Pdo(NodeId, u8, &'d [u8]),
    /// `1 SYNC`, with its counter where it has one; ours.
    Sync(Option<u8>),
}

impl What<'_> {
    /// Of which kind it is.
    pub const fn kind(&self) -> Kinds {
        match self {
            Self::BootUp(_) => Kinds::BOOT_UP,
            Self::Emergency(..) => Kinds::EMCY,
            Self::Error(None, _) => Kinds::BUS,
            Self::Error(Some(_), _) | Self::State(..) | Self::Duplicate(_) => Kinds::HEARTBEAT,
            Self::Pdo(..) => Kinds::PDO,
            Self::Sync(_) => Kinds::SYNC,
        }
    }
}

impl fmt::Display for Indication<'_> {
    /// The line, with its end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}\r\n", self.net, self.what)
    }
}

impl fmt::Display for What<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BootUp(node) => write!(f, "{node} BOOT_UP"),
            Self::Emergency(node, emergency) => {
                write!(f, "{node} EMCY {:04X} {:02X}", emergency.code, emergency.register)?;
                emergency.vendor.iter().try_for_each(|byte| write!(f, " {byte}"))
            }
            Self::Error(node, error) => {
                write!(f, "{} ERROR {} #{}", node.map_or(0, NodeId::value), error.code(), error.text())
            }
            Self::State(node, state) => write!(f, "{node} STATE {state}"),
            Self::Duplicate(node) => write!(f, "{node} DUPLICATE"),
            Self::Pdo(node, number, data) => {
                write!(f, "{node} PDO {number}")?;
                data.iter().try_for_each(|byte| write!(f, " {byte:02X}"))
            }
            Self::Sync(None) => f.write_str("SYNC"),
            Self::Sync(Some(counter)) => write!(f, "SYNC {counter}"),
        }
    }
}
