//! The entries of PDO parameters.

use crate::Address;
use crate::frame::{Id, MAX_BASE};

/// A COB-ID entry of a PDO (sub-index 1 of its communication parameter).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CobId {
    /// The PDO exists: bit 31 is 0.
    pub valid: bool,
    /// It may be asked for by a remote frame: bit 30 is 0. Of receive PDOs it says nothing.
    pub remote: bool,
    /// Its identifier; bit 29 says that it is an extended one.
    pub id: Id,
}

impl CobId {
    const INVALID: u32 = 1 << 31;
    const NO_REMOTE: u32 = 1 << 30;
    const EXTENDED: u32 = 1 << 29;

    /// A PDO that exists and is not asked for, with a base identifier.
    pub const fn new(id: u16) -> Self {
        Self { valid: true, remote: false, id: Id::base(id) }
    }

    /// The same, not existing.
    pub const fn invalid(self) -> Self {
        Self { valid: false, ..self }
    }

    /// The entry.
    pub const fn raw(self) -> u32 {
        let valid = if self.valid { 0 } else { Self::INVALID };
        let remote = if self.remote { 0 } else { Self::NO_REMOTE };
        match self.id {
            Id::Base(id) => valid | remote | (id & MAX_BASE) as u32,
            Id::Extended(id) => valid | remote | Self::EXTENDED | Id::extended(id).raw(),
        }
    }

    /// What an entry says. Bits 11 to 28 of one with a base identifier are not looked at.
    pub const fn from_raw(raw: u32) -> Self {
        let id = if raw & Self::EXTENDED == 0 {
            Id::base((raw & MAX_BASE as u32) as u16)
        } else {
            Id::extended(raw)
        };
        Self { valid: raw & Self::INVALID == 0, remote: raw & Self::NO_REMOTE == 0, id }
    }
}

/// A value that the standard reserves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reserved;

/// When a PDO is sent, or takes effect (sub-index 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transmission {
    /// At the SYNC after something happened: 0.
    SyncAcyclic,
    /// At every so many SYNCs: 1 to 240.
    SyncCyclic(u8),
    /// Sampled at SYNC, sent when asked for: 252.
    RemoteSync,
    /// Sampled and sent when asked for: 253.
    Remote,
    /// When something happens, by the manufacturer: 254.
    EventVendor,
    /// When something happens, by the device profile: 255.
    EventProfile,
}

impl Transmission {
    /// Its code; a cycle outside of 1 to 240 is brought into it.
    pub const fn code(self) -> u8 {
        match self {
            Self::SyncAcyclic => 0,
            Self::SyncCyclic(0) => 1,
            Self::SyncCyclic(241..) => 240,
            Self::SyncCyclic(every) => every,
            Self::RemoteSync => 252,
            Self::Remote => 253,
            Self::EventVendor => 254,
            Self::EventProfile => 255,
        }
    }

    /// # Errors
    /// `Reserved`: 241 to 251.
    pub const fn from_code(code: u8) -> Result<Self, Reserved> {
        Ok(match code {
            0 => Self::SyncAcyclic,
            1..=240 => Self::SyncCyclic(code),
            241..=251 => return Err(Reserved),
            252 => Self::RemoteSync,
            253 => Self::Remote,
            254 => Self::EventVendor,
            255 => Self::EventProfile,
        })
    }
}

/// An object in a PDO: an entry of a mapping parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mapped {
    /// The object; indexes 1 to 7 are dummies, whose bits nobody takes.
    pub address: Address,
    /// Its length, 1 to 64 bits.
    pub bits: u8,
}

impl Mapped {
    /// An object of a length.
    pub const fn new(index: u16, sub: u8, bits: u8) -> Self {
        Self { address: Address::new(index, sub), bits }
    }

    /// The entry: index, sub-index, length, from the highest byte down.
    pub const fn raw(self) -> u32 {
        (self.address.index as u32) << 16 | (self.address.sub as u32) << 8 | self.bits as u32
    }

    /// What an entry says.
    pub const fn from_raw(raw: u32) -> Self {
        Self::new((raw >> 16) as u16, (raw >> 8) as u8, raw as u8)
    }
}
