//! Concise DCF: a list of values for a node, as in object 1F22h (CiA 302-3).

use core::fmt;

use crate::Address;

/// A value of the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'a> {
    /// Where it belongs.
    pub address: Address,
    /// Its bytes, the low one first.
    pub data: &'a [u8],
}

/// Why bytes are no list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadDcf {
    /// They end within an entry, or before its number is reached.
    TooShort {
        /// Of the entry that is not whole, from 0.
        entry: u32,
    },
    /// Bytes are left over after the last entry.
    TooLong {
        /// So many.
        left: usize,
    },
    /// An entry without data.
    Empty {
        /// Which.
        address: Address,
    },
}

impl fmt::Display for BadDcf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort { entry } => write!(f, "the list ends within entry {entry}"),
            Self::TooLong { left } => write!(f, "{left} bytes are left over after the list"),
            Self::Empty { address } => write!(f, "{address} has no value"),
        }
    }
}

impl core::error::Error for BadDcf {}

/// A list that is whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct List<'a> {
    /// Entries without their number.
    entries: &'a [u8],
}

impl<'a> List<'a> {
    /// The list without entries.
    pub const EMPTY: Self = Self { entries: &[] };

    /// The list that `bytes` are: the number of entries, 32 bits; of each its index, sub-index, length in 32 bits, and data.
    ///
    /// # Errors
    /// Any [`BadDcf`].
    pub fn parse(bytes: &'a [u8]) -> Result<Self, BadDcf> {
        let (count, entries) = bytes.split_first_chunk().ok_or(BadDcf::TooShort { entry: 0 })?;
        let mut rest = entries;
        for entry in 0..u32::from_le_bytes(*count) {
            let (found, after) = split(rest).ok_or(BadDcf::TooShort { entry })?;
            if found.data.is_empty() {
                return Err(BadDcf::Empty { address: found.address });
            }
            rest = after;
        }
        if rest.is_empty() { Ok(Self { entries }) } else { Err(BadDcf::TooLong { left: rest.len() }) }
    }

    /// Its entries, in their order.
    pub fn entries(&self) -> impl Iterator<Item = Entry<'a>> + use<'a> {
        let mut rest = self.entries;
        core::iter::from_fn(move || {
            let (entry, after) = split(rest)?;
            rest = after;
            Some(entry)
        })
    }

    /// The entry of a number, from 0.
    pub fn get(&self, number: usize) -> Option<Entry<'a>> {
        self.entries().nth(number)
    }
}

/// The first entry, and what follows.
fn split(bytes: &[u8]) -> Option<(Entry<'_>, &[u8])> {
    let (&[low, high, sub, a, b, c, d], rest) = bytes.split_first_chunk()?;
    let length = usize::try_from(u32::from_le_bytes([a, b, c, d])).ok()?;
    let (data, rest) = rest.split_at_checked(length)?;
    Some((Entry { address: Address::from_bytes([low, high, sub]), data }, rest))
}

/// Puts an entry behind those of a list; an empty buffer is taken for the empty list.
///
/// # Errors
/// `Err` where there is no room, the data are empty, or the buffer is no list; it has not changed then.
pub fn push<const N: usize>(list: &mut heapless::Vec<u8, N>, entry: Entry<'_>) -> Result<(), Full> {
    let before = if list.is_empty() { 4 } else { list.len() };
    let whole = before.saturating_add(7).saturating_add(entry.data.len());
    let count = match list.first_chunk() {
        None if list.is_empty() => 0,
        None => return Err(Full),
        Some(count) => u32::from_le_bytes(*count),
    };
    if entry.data.is_empty() || whole > N {
        return Err(Full);
    }
    let count = count.checked_add(1).ok_or(Full)?;
    let length = u32::try_from(entry.data.len()).map_err(|_| Full)?;
    if list.is_empty() {
        list.extend_from_slice(&[0; 4]).map_err(|_| Full)?;
    }
    if let Some(first) = list.first_chunk_mut() {
        *first = count.to_le_bytes();
    }
    let parts: [&[u8]; 3] = [&entry.address.to_bytes(), &length.to_le_bytes(), entry.data];
    parts.into_iter().try_for_each(|part| list.extend_from_slice(part).map_err(|_| Full))
}

/// There is no room for an entry, or it is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;
