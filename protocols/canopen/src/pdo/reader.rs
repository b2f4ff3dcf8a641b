//! How a PDO is set up, read from the node.

use core::fmt;

use heapless::Vec;

use super::{CobId, Mapped, Pdo, Transmission, sub};
use crate::Address;

/// How a PDO is set up: `N` objects at most.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout<const N: usize> {
    /// Which.
    pub pdo: Pdo,
    /// Its COB-ID, and whether it exists.
    pub cob_id: CobId,
    /// When it is sent; `None` where the node says what is reserved.
    pub transmission: Option<Transmission>,
    /// What is in it.
    pub mapping: Vec<Mapped, N>,
}

/// Why what a node says is no layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadAnswer {
    /// The value has another length.
    Size {
        /// Of this object.
        address: Address,
        /// Bytes that came.
        received: usize,
    },
    /// More objects than there is room for, or a multiplexed PDO.
    TooMany {
        /// So many.
        count: u8,
    },
}

impl fmt::Display for BadAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { address, received } => write!(f, "{address} has {received} bytes"),
            Self::TooMany { count } => write!(f, "a PDO with {count} objects"),
        }
    }
}

impl core::error::Error for BadAnswer {}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    CobId,
    Transmission,
    Count,
    Entry { number: u8, of: u8 },
    Done,
}

/// Reads how a PDO is set up: [`Reader::wants`] says what to read, [`Reader::take`] takes it.
#[derive(Clone, Debug)]
pub struct Reader<const N: usize> {
    step: Step,
    layout: Layout<N>,
}

impl<const N: usize> Reader<N> {
    /// Nothing has been read.
    pub const fn new(pdo: Pdo) -> Self {
        let layout = Layout { pdo, cob_id: CobId::new(0), transmission: None, mapping: Vec::new() };
        Self { step: Step::CobId, layout }
    }

    /// The object to read next; `None` when all is known.
    pub const fn wants(&self) -> Option<Address> {
        let pdo = self.layout.pdo;
        Some(match self.step {
            Step::CobId => pdo.communication(sub::COB_ID),
            Step::Transmission => pdo.communication(sub::TRANSMISSION),
            Step::Count => pdo.mapping(0),
            Step::Entry { number, .. } => pdo.mapping(number),
            Step::Done => return None,
        })
    }

    /// Takes the value of that object.
    ///
    /// # Errors
    /// Any [`BadAnswer`]; nothing has changed.
    pub fn take(&mut self, value: &[u8]) -> Result<(), BadAnswer> {
        let Some(address) = self.wants() else {
            return Ok(());
        };
        let size = BadAnswer::Size { address, received: value.len() };
        let byte = || value.first().copied().filter(|_| value.len() == 1).ok_or(size);
        let word = || value.try_into().map(u32::from_le_bytes).map_err(|_| size);
        self.step = match self.step {
            Step::CobId => {
                self.layout.cob_id = CobId::from_raw(word()?);
                Step::Transmission
            }
            Step::Transmission => {
                self.layout.transmission = Transmission::from_code(byte()?).ok();
                Step::Count
            }
            Step::Count => match byte()? {
                0 => Step::Done,
                count if usize::from(count) > N => return Err(BadAnswer::TooMany { count }),
                of => Step::Entry { number: 1, of },
            },
            Step::Entry { number, of } => {
                let _ = self.layout.mapping.push(Mapped::from_raw(word()?));
                if number < of { Step::Entry { number: number + 1, of } } else { Step::Done }
            }
            Step::Done => Step::Done,
        };
        Ok(())
    }

    /// The layout, when all is known.
    pub fn layout(&self) -> Option<&Layout<N>> {
        (self.step == Step::Done).then_some(&self.layout)
    }
}
