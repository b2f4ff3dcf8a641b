//! Which unit ids a bus serves.

use core::fmt;
use core::str::FromStr;

/// A set of Modbus unit ids, written as in `1-16,20`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Units([u32; 8]);

/// A text that is no set of unit ids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadUnits;

impl fmt::Display for BadUnits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected unit ids from 1 to 247, as in 1-16,20")
    }
}

impl Units {
    /// None of them.
    pub const fn none() -> Self {
        Self([0; 8])
    }

    /// Whether this unit id belongs to the set.
    pub fn contains(&self, unit: u8) -> bool {
        self.0.get(usize::from(unit / 32)).is_some_and(|word| word & (1 << (unit % 32)) != 0)
    }

    /// Adds a unit id.
    pub fn insert(&mut self, unit: u8) {
        if let Some(word) = self.0.get_mut(usize::from(unit / 32)) {
            *word |= 1 << (unit % 32);
        }
    }

    /// The ids of the set, ascending.
    pub fn iter(&self) -> impl Iterator<Item = u8> + '_ {
        (0..=255).filter(|unit| self.contains(*unit))
    }

    /// The lowest id that both sets have.
    pub fn overlap(&self, other: &Self) -> Option<u8> {
        self.iter().find(|unit| other.contains(*unit))
    }
}

impl FromStr for Units {
    type Err = BadUnits;

    fn from_str(text: &str) -> Result<Self, BadUnits> {
        let mut units = Self::default();
        for part in text.split(',') {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let id = |text: &str| match text.trim().parse() {
                Ok(id @ 1..=247_u8) => Ok(id),
                _ => Err(BadUnits),
            };
            let (first, last) = (id(first)?, id(last)?);
            if first > last {
                return Err(BadUnits);
            }
            (first..=last).for_each(|unit| units.insert(unit));
        }
        Ok(units)
    }
}

impl fmt::Display for Units {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        let mut units = self.iter().peekable();
        while let Some(first) = units.next() {
            let mut last = first;
            while let Some(next) = units.next_if(|next| *next == last + 1) {
                last = next;
            }
            if first == last {
                write!(f, "{separator}{first}")?;
            } else {
                write!(f, "{separator}{first}-{last}")?;
            }
            separator = ",";
        }
        Ok(())
    }
}
