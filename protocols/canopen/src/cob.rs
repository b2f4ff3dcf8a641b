//! Node-IDs, and which COB-ID belongs to what.

use core::fmt;

use crate::frame::Id;

/// NMT node control (7.2.8.3.1).
pub const NMT: u16 = 0x000;
/// SYNC as delivered (7.3.3).
pub const SYNC: u16 = 0x080;
/// TIME as delivered (7.3.3).
pub const TIME: u16 = 0x100;
/// What LSS slaves say (CiA 305).
pub const LSS_SLAVE: u16 = 0x7E4;
/// What the LSS master says (CiA 305).
pub const LSS_MASTER: u16 = 0x7E5;

/// Node-ID, 1 to 127.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(u8);

impl NodeId {
    /// The lowest.
    pub const MIN: Self = Self(1);
    /// The highest.
    pub const MAX: Self = Self(127);

    /// A node-ID; `None` outside of 1 to 127.
    pub const fn new(id: u8) -> Option<Self> {
        match id {
            1..=127 => Some(Self(id)),
            _ => None,
        }
    }

    /// Its number, 1 to 127.
    pub const fn value(self) -> u8 {
        self.0
    }

    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        (1..=127).map(Self)
    }

    const fn of(self, function: u16) -> u16 {
        function | self.0 as u16
    }

    /// Its emergency messages.
    pub const fn emcy(self) -> u16 {
        self.of(0x080)
    }

    /// What its first SDO server says.
    pub const fn sdo_response(self) -> u16 {
        self.of(0x580)
    }

    /// What its first SDO server is told.
    pub const fn sdo_request(self) -> u16 {
        self.of(0x600)
    }

    /// Its boot-up, heartbeat and guarding messages.
    pub const fn error_control(self) -> u16 {
        self.of(0x700)
    }

    /// Its transmit PDO 1 to 4 as delivered; `None` for others, which have none.
    pub const fn tpdo(self, number: u16) -> Option<u16> {
        match number {
            1..=4 => Some(self.of(0x080 + 0x100 * number)),
            _ => None,
        }
    }

    /// Its receive PDO 1 to 4 as delivered; `None` for others, which have none.
    pub const fn rpdo(self, number: u16) -> Option<u16> {
        match number {
            1..=4 => Some(self.of(0x100 + 0x100 * number)),
            _ => None,
        }
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// What a COB-ID is for, where nothing has been configured otherwise (7.3.3, tables of the generic pre-defined
/// connection set; LSS: CiA 305).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// NMT node control.
    Nmt,
    /// SYNC.
    Sync,
    /// Time stamp.
    Time,
    /// Emergency message of a node.
    Emcy(NodeId),
    /// Transmit PDO 1 to 4 of a node.
    Tpdo(u8, NodeId),
    /// Receive PDO 1 to 4 of a node.
    Rpdo(u8, NodeId),
    /// From the SDO server of a node.
    SdoResponse(NodeId),
    /// To the SDO server of a node.
    SdoRequest(NodeId),
    /// Boot-up, heartbeat or guarding of a node.
    ErrorControl(NodeId),
    /// From an LSS slave.
    LssSlave,
    /// From the LSS master.
    LssMaster,
}

impl Function {
    /// The function of a COB-ID; `None` where the set has none.
    pub const fn of(id: Id) -> Option<Self> {
        let Id::Base(id) = id else {
            return None;
        };
        match id {
            NMT => return Some(Self::Nmt),
            SYNC => return Some(Self::Sync),
            TIME => return Some(Self::Time),
            LSS_SLAVE => return Some(Self::LssSlave),
            LSS_MASTER => return Some(Self::LssMaster),
            _ => {}
        }
        let Some(node) = NodeId::new((id & 0x7F) as u8) else {
            return None;
        };
        let code = (id >> 7) as u8;
        Some(match code {
            1 => Self::Emcy(node),
            3 | 5 | 7 | 9 => Self::Tpdo(code / 2, node),
            4 | 6 | 8 | 10 => Self::Rpdo(code / 2 - 1, node),
            11 => Self::SdoResponse(node),
            12 => Self::SdoRequest(node),
            14 => Self::ErrorControl(node),
            _ => return None,
        })
    }
}

/// Whether no configured object may have this base identifier (7.3.5).
pub const fn is_restricted(id: u16) -> bool {
    matches!(id,
        0x000..=0x07F | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..=0x77F | 0x780..=0x7FF)
}
