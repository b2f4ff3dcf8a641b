//! What a client may write to the communication profile's objects, and when.

use puente_canopen::pdo::{CobId, Mapped, Transmission};
use puente_canopen::sdo::Abort;
use puente_canopen::{Address, Id, cob};

use super::Objects;
use super::communication::{LOAD, MAPPED, SAVE};

/// Data bits of a PDO.
const PDO_BITS: usize = 64;

/// Whether a value may be written now.
///
/// # Errors
/// Why not.
pub fn check(objects: &Objects, address: Address, value: &[u8]) -> Result<(), Abort> {
    let number = value.iter().rev().take(4).fold(0_u32, |number, byte| number << 8 | u32::from(*byte));
    match (address.index, address.sub) {
        (0x1003, 0) => allow(number == 0, Abort::VALUE),
        (0x1005, 0) => allow(number >> 29 == 0 && number <= u32::from(u16::MAX), Abort::VALUE),
        (0x1010, 1) => allow(number == SAVE, Abort::TRANSFER),
        (0x1011, 1) => allow(number == LOAD, Abort::TRANSFER),
        (0x1019, 0) => allow(matches!(number, 0 | 2..=240), Abort::VALUE),
        (0x1400..=0x15FF | 0x1800..=0x19FF, sub) => communication(objects, address.index, sub, number),
        (0x1600..=0x17FF | 0x1A00..=0x1BFF, sub) => mapping(objects, address.index, sub, number),
        _ => Ok(()),
    }
}

fn allow(right: bool, code: Abort) -> Result<(), Abort> {
    if right { Ok(()) } else { Err(code) }
}

fn communication(objects: &Objects, index: u16, sub: u8, number: u32) -> Result<(), Abort> {
    let receives = index < 0x1800;
    let now = CobId::from_raw(objects.get(Address::new(index, 1)) as u32);
    match sub {
        1 => {
            let new = CobId::from_raw(number);
            let Id::Base(id) = new.id else { return Err(Abort::VALUE) };
            allow(!new.valid || !cob::is_restricted(id), Abort::VALUE)?;
            allow(!now.valid || !new.valid || now.id == new.id, Abort::VALUE)
        }
        2 => match Transmission::from_code(number as u8) {
            Err(_) => Err(Abort::VALUE),
            Ok(Transmission::Remote | Transmission::RemoteSync) => allow(!receives, Abort::VALUE),
            Ok(_) => Ok(()),
        },
        // Not while the PDO exists (7.5.2.37).
        3 | 6 => allow(!now.valid, Abort::DEVICE_STATE),
        _ => Ok(()),
    }
}

fn mapping(objects: &Objects, index: u16, sub: u8, number: u32) -> Result<(), Abort> {
    let receives = index < 0x1800;
    let now = CobId::from_raw(objects.get(Address::new(index - 0x200, 1)) as u32);
    allow(!now.valid, Abort::UNSUPPORTED)?;
    if sub > 0 {
        // Nothing is changed that is in use.
        allow(objects.get(Address::new(index, 0)) == 0, Abort::UNSUPPORTED)?;
        return bits(objects, Mapped::from_raw(number), receives).map(|_| ());
    }
    allow(number <= MAPPED.into(), Abort::VALUE)?;
    let entries =
        (1..=number as u8).map(|sub| Mapped::from_raw(objects.get(Address::new(index, sub)) as u32));
    let mut total = 0;
    for entry in entries {
        total += bits(objects, entry, receives)?;
    }
    allow(total <= PDO_BITS, Abort::MAPPING_LENGTH)
}

/// The bits of an object that may be mapped.
fn bits(objects: &Objects, mapped: Mapped, receives: bool) -> Result<usize, Abort> {
    let bits = usize::from(mapped.bits);
    // Dummies of CiA 301: signed and unsigned numbers of 8, 16 and 32 bits.
    let dummy = match (mapped.address.index, mapped.address.sub) {
        (2 | 5, 0) => Some(8),
        (3 | 6, 0) => Some(16),
        (4 | 7, 0) => Some(32),
        _ => None,
    };
    let has = match dummy.filter(|_| receives) {
        Some(bits) => bits,
        None => 8 * objects.check_mapped(mapped.address, receives)?,
    };
    allow(bits == has, Abort::NOT_MAPPABLE)?;
    Ok(bits)
}
