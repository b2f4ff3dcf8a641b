//! What is in flash: the confirmed document, and the one on trial where there is any, in one record. So each write is
//! atomic, and the newest record that is whole is all there is to know.
//!
//! Documents are compact (postcard), not text: two of the largest fit the buffer that one of them needs as JSON. The
//! price is that a document has no keys: any change of what old documents have is a new `FORMAT`, with a reader for each
//! old one that is to stay readable. A record of another format is refused as a whole. What is only added follows after the
//! rest, where it says something (`Later`, then `Cyclic`).

use serde::Serialize;
use serde::de::DeserializeSeed;

use super::Settings;
use super::document::{Cyclic, Later, Place, cyclic, later};

/// Number of the form that records and documents have.
const FORMAT: u8 = 1;
/// What each record begins with: whose it is, and its form.
const MAGIC: [u8; 3] = [b'p', b'S', FORMAT];

const STATE: usize = 3;
const SERIAL: core::ops::Range<usize> = 4..8;
const CONFIRMED: core::ops::Range<usize> = 8..10;
const HEAD: usize = 10;

/// The document on trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trial {
    /// There is none.
    None,
    /// It has not been in force yet.
    New,
    /// It has had its start.
    Started,
}

impl Trial {
    const fn byte(self) -> u8 {
        match self {
            Trial::None => 0,
            Trial::New => 1,
            Trial::Started => 2,
        }
    }

    const fn find(byte: u8) -> Option<Self> {
        Some(match byte {
            0 => Trial::None,
            1 => Trial::New,
            2 => Trial::Started,
            _ => return None,
        })
    }
}

/// Why something cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge;

/// A record, in the bytes where it is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'r> {
    /// Greater than that of every older record.
    pub serial: u32,
    /// State of the trial.
    pub trial: Trial,
    confirmed: &'r [u8],
    tried: &'r [u8],
}

/// A document that this firmware cannot read, or that does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreadable;

impl<'r> Record<'r> {
    /// The record that these bytes are, all of them.
    pub fn parse(bytes: &'r [u8]) -> Option<Self> {
        let body = bytes.strip_prefix(&MAGIC).and(bytes.get(HEAD..))?;
        let trial = Trial::find(*bytes.get(STATE)?)?;
        let serial = u32::from_le_bytes(bytes.get(SERIAL)?.try_into().ok()?);
        let length = u16::from_le_bytes(bytes.get(CONFIRMED)?.try_into().ok()?);
        let (confirmed, tried) = body.split_at_checked(length.into())?;
        Some(Self { serial, trial, confirmed, tried })
    }

    /// Reads the last confirmed document into its place; false where it is the factory settings, which are not here.
    /// Where that fails, the place is as before.
    pub fn confirmed(&self, settings: &mut Settings) -> Result<bool, Unreadable> {
        document(self.confirmed, settings)
    }

    /// As [`confirmed`](Self::confirmed), the document on trial.
    pub fn tried(&self, settings: &mut Settings) -> Result<bool, Unreadable> {
        document(self.tried, settings)
    }
}

#[inline(never)]
fn document(bytes: &[u8], settings: &mut Settings) -> Result<bool, Unreadable> {
    if bytes.is_empty() {
        return Ok(false);
    }
    let mut found = Settings::blank();
    let mut rest = part(Place(&mut found), bytes)?;
    if !rest.is_empty() {
        rest = part(Later(&mut found), rest)?;
    }
    if !rest.is_empty() {
        rest = part(Cyclic(&mut found), rest)?;
    }
    if !rest.is_empty() || found.check().is_err() {
        return Err(Unreadable);
    }
    settings.clone_from(&found);
    Ok(true)
}

/// Reads a part of a document: what follows it.
fn part<'d, P: DeserializeSeed<'d>>(part: P, bytes: &'d [u8]) -> Result<&'d [u8], Unreadable> {
    let mut deserializer = postcard::Deserializer::from_bytes(bytes);
    part.deserialize(&mut deserializer).map_err(|_| Unreadable)?;
    deserializer.finalize().map_err(|_| Unreadable)
}

/// Writes a record, whose serial number is stamped later: its length.
pub fn emit(
    buffer: &mut [u8],
    confirmed: Option<&Settings>,
    trial: Option<Option<&Settings>>,
) -> Result<usize, TooLarge> {
    let state = if trial.is_some() { Trial::New } else { Trial::None };
    let (head, body) = buffer.split_at_mut_checked(HEAD).ok_or(TooLarge)?;
    let length = write(body, confirmed)?;
    let tried = write(body.get_mut(length..).unwrap_or_default(), trial.flatten())?;
    head.fill(0);
    put(head, 0..MAGIC.len(), &MAGIC);
    put(head, STATE..STATE + 1, &[state.byte()]);
    put(head, CONFIRMED, &u16::try_from(length).map_err(|_| TooLarge)?.to_le_bytes());
    Ok(HEAD + length + tried)
}

fn write(buffer: &mut [u8], document: Option<&Settings>) -> Result<usize, TooLarge> {
    let Some(settings) = document else { return Ok(0) };
    let cyclic = cyclic(settings);
    let written = write_part(buffer, 0, Some(settings))?;
    let written = write_part(buffer, written, later(settings, cyclic.is_some()))?;
    write_part(buffer, written, cyclic)
}

/// Writes a part of a document behind what has been written: how much has been then.
fn write_part(buffer: &mut [u8], written: usize, part: Option<impl Serialize>) -> Result<usize, TooLarge> {
    let Some(part) = part else { return Ok(written) };
    let rest = buffer.get_mut(written..).unwrap_or_default();
    postcard::to_slice(&part, rest).map(|rest| written + rest.len()).map_err(|_| TooLarge)
}

/// Gives the record in these bytes its serial number.
pub fn stamp(record: &mut [u8], serial: u32) {
    put(record, SERIAL, &serial.to_le_bytes());
}

/// Notes in the record in these bytes that the document on trial has its start now.
pub fn start(record: &mut [u8]) {
    put(record, STATE..STATE + 1, &[Trial::Started.byte()]);
}

/// Makes the document on trial, which has had its start, the confirmed one: the new length of the record in these
/// bytes.
pub fn confirm(record: &mut [u8]) -> Option<usize> {
    let tried = Record::parse(record).filter(|record| record.trial == Trial::Started)?.tried.len();
    let length = u16::try_from(tried).ok()?;
    record.copy_within(record.len() - tried.., HEAD);
    put(record, STATE..STATE + 1, &[Trial::None.byte()]);
    put(record, CONFIRMED, &length.to_le_bytes());
    Some(HEAD + tried)
}

/// Copies `bytes` to a place of the head, which every record has.
fn put(record: &mut [u8], place: core::ops::Range<usize>, bytes: &[u8]) {
    if let Some(place) = record.get_mut(place) {
        place.copy_from_slice(bytes);
    }
}
