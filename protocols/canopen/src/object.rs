//! Where a value is in a node's object dictionary (7.4).

use core::fmt;

/// Address of a value: index and sub-index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    /// Index.
    pub index: u16,
    /// Sub-index; 0 where the object is a plain variable.
    pub sub: u8,
}

impl Address {
    /// An address.
    pub const fn new(index: u16, sub: u8) -> Self {
        Self { index, sub }
    }

    /// As in an SDO: index with the low byte first, sub-index (7.2.4.3).
    pub const fn to_bytes(self) -> [u8; 3] {
        let [low, high] = self.index.to_le_bytes();
        [low, high, self.sub]
    }

    /// See [`Address::to_bytes`].
    pub const fn from_bytes([low, high, sub]: [u8; 3]) -> Self {
        Self { index: u16::from_le_bytes([low, high]), sub }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h:{}", self.index, self.sub)
    }
}

/// Device type (7.5.2.1); the profile's number is in the low 16 bits.
pub const DEVICE_TYPE: Address = Address::new(0x1000, 0);
/// Error register (7.5.2.2).
pub const ERROR_REGISTER: Address = Address::new(0x1001, 0);
/// COB-ID of SYNC (7.5.2.5).
pub const SYNC_COB_ID: Address = Address::new(0x1005, 0);
/// Communication cycle period, us (7.5.2.6).
pub const CYCLE_PERIOD: Address = Address::new(0x1006, 0);
/// Guard time, ms.
pub const GUARD_TIME: Address = Address::new(0x100C, 0);
/// Life time factor.
pub const LIFE_TIME_FACTOR: Address = Address::new(0x100D, 0);
/// Consumer heartbeat time: of the first node that is watched, its node-ID in bits 16 to 23, the time in ms below.
pub const HEARTBEAT_CONSUMER: Address = Address::new(0x1016, 1);
/// Producer heartbeat time, ms.
pub const HEARTBEAT_TIME: Address = Address::new(0x1017, 0);
/// Identity: vendor.
pub const VENDOR: Address = Address::new(0x1018, 1);
/// Identity: product code.
pub const PRODUCT: Address = Address::new(0x1018, 2);
/// Identity: revision.
pub const REVISION: Address = Address::new(0x1018, 3);
/// Identity: serial number.
pub const SERIAL: Address = Address::new(0x1018, 4);
/// Overflow of the SYNC counter.
pub const SYNC_OVERFLOW: Address = Address::new(0x1019, 0);
