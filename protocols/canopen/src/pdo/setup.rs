//! How a PDO is set up.

use core::fmt;

use super::{CobId, Direction, MAX_MAPPED, Mapped, Pdo, Transmission, sub};
use crate::cob;
use crate::{Address, Id};

/// What a PDO is to be. What is `None` is left as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setup<'a> {
    /// Which.
    pub pdo: Pdo,
    /// Its COB-ID, and whether it exists in the end.
    pub cob_id: CobId,
    /// Its COB-ID now, where that is known: the identifier of a PDO that exists may not be changed, not even while it is
    /// switched off, by some nodes.
    pub now: Option<CobId>,
    /// When it is sent.
    pub transmission: Option<Transmission>,
    /// Least time between two of them, 100 us.
    pub inhibit: Option<u16>,
    /// Of a transmit PDO: it is sent so often at least; of a receive PDO: it is missed after so long. ms.
    pub event_timer: Option<u16>,
    /// Of a transmit PDO: the SYNC counter that its cycle begins with; 0: any.
    pub sync_start: Option<u8>,
    /// What is in it.
    pub mapping: Option<&'a [Mapped]>,
}

/// Why a PDO cannot be set up so.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadSetup {
    /// More than 64 objects.
    TooMany,
    /// More than 64 bits, or an object of none.
    Length {
        /// So many.
        bits: u32,
    },
    /// The identifier belongs to another service (7.3.5).
    Restricted {
        /// It.
        id: u16,
    },
    /// Only transmit PDOs have a SYNC start value.
    SyncStart,
}

impl fmt::Display for BadSetup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooMany => f.write_str("more than 64 objects in a PDO"),
            Self::Length { bits } => write!(f, "{bits} bits in a PDO, or an object without any"),
            Self::Restricted { id } => write!(f, "COB-ID {id:03X}h belongs to another service"),
            Self::SyncStart => f.write_str("only transmit PDOs have a SYNC start value"),
        }
    }
}

impl core::error::Error for BadSetup {}

/// A value to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Write {
    /// Where.
    pub address: Address,
    /// What.
    pub value: u32,
    /// Its length, 1, 2 or 4 bytes.
    pub size: u8,
}

impl Write {
    const fn new(address: Address, value: u32, size: u8) -> Self {
        Self { address, value, size }
    }

    /// Four bytes, of which the first [`Write::size`] are written.
    pub const fn bytes(&self) -> [u8; 4] {
        self.value.to_le_bytes()
    }
}

impl<'a> Setup<'a> {
    /// That a PDO exists, and nothing else.
    pub const fn new(pdo: Pdo, cob_id: CobId) -> Self {
        Self {
            pdo,
            cob_id,
            now: None,
            transmission: None,
            inhibit: None,
            event_timer: None,
            sync_start: None,
            mapping: None,
        }
    }

    /// The writes that bring it about, in the order of 7.5.2.36: the PDO is switched off, its mapping emptied, filled and
    /// switched on, the rest set, and the PDO switched on. The node must be pre-operational, or leave it alone meanwhile.
    ///
    /// # Errors
    /// Any [`BadSetup`].
    pub fn writes(&self) -> Result<impl Iterator<Item = Write> + 'a, BadSetup> {
        self.check()?;
        let Self { pdo, cob_id, .. } = *self;
        let off = Write::new(pdo.communication(sub::COB_ID), self.now.unwrap_or(cob_id).invalid().raw(), 4);
        let mapping = self.mapping.map(|mapping| {
            let count = |count| Write::new(pdo.mapping(0), count, 1);
            let entry = move |(at, mapped): (usize, &Mapped)| {
                Write::new(pdo.mapping((at + 1) as u8), mapped.raw(), 4)
            };
            let entries = mapping.iter().enumerate().map(entry);
            core::iter::once(count(0)).chain(entries).chain([count(mapping.len() as u32)])
        });
        let value = |sub, value: u32, size| Write::new(pdo.communication(sub), value, size);
        let rest = [
            self.transmission.map(|kind| value(sub::TRANSMISSION, kind.code().into(), 1)),
            self.inhibit.map(|time| value(sub::INHIBIT, time.into(), 2)),
            self.event_timer.map(|time| value(sub::EVENT_TIMER, time.into(), 2)),
            self.sync_start.map(|count| value(sub::SYNC_START, count.into(), 1)),
            // What is to be off in the end is off with its new identifier, where it has one.
            (cob_id.valid || off.value != cob_id.raw()).then(|| value(sub::COB_ID, cob_id.raw(), 4)),
        ];
        Ok(core::iter::once(off).chain(mapping.into_iter().flatten()).chain(rest.into_iter().flatten()))
    }

    fn check(&self) -> Result<(), BadSetup> {
        if let Some(mapping) = self.mapping {
            if mapping.len() > MAX_MAPPED {
                return Err(BadSetup::TooMany);
            }
            let bits = mapping.iter().map(|mapped| u32::from(mapped.bits)).sum();
            if bits > 64 || mapping.iter().any(|mapped| mapped.bits == 0) {
                return Err(BadSetup::Length { bits });
            }
        }
        match self.cob_id.id {
            Id::Base(id) if cob::is_restricted(id) && self.cob_id.valid => {
                return Err(BadSetup::Restricted { id });
            }
            _ => {}
        }
        if self.sync_start.is_some() && self.pdo.direction() == Direction::Receive {
            return Err(BadSetup::SyncStart);
        }
        Ok(())
    }
}
