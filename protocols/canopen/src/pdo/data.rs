//! Values in a PDO's data: one after the other, the lowest bit first (7.1.3, 7.5.2.36).

use super::Mapped;
use crate::Address;

/// Bytes of a PDO with these objects.
pub fn bytes(mapping: &[Mapped]) -> usize {
    mapping.iter().map(|mapped| usize::from(mapped.bits)).sum::<usize>().div_ceil(8)
}

/// Each object with where it begins, bits.
fn placed(mapping: &[Mapped]) -> impl Iterator<Item = (Mapped, u32)> {
    mapping.iter().scan(0_u32, |next, mapped| {
        let at = *next;
        *next = at.saturating_add(u32::from(mapped.bits));
        Some((*mapped, at))
    })
}

fn mask(bits: u8) -> u64 {
    match bits {
        64.. => u64::MAX,
        bits => (1 << bits) - 1,
    }
}

fn word(data: &[u8]) -> u64 {
    data.iter().take(8).rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

/// The objects with their values, not extended by their sign; those that the data are too short for are left out.
pub fn values(mapping: &[Mapped], data: &[u8]) -> impl Iterator<Item = (Mapped, u64)> {
    let (word, bits) = (word(data), 8 * data.len().min(8) as u32);
    placed(mapping)
        .take_while(move |(mapped, at)| at.saturating_add(u32::from(mapped.bits)) <= bits)
        .map(move |(mapped, at)| (mapped, word.checked_shr(at).unwrap_or(0) & mask(mapped.bits)))
}

/// The value of one object.
pub fn value(mapping: &[Mapped], data: &[u8], address: Address) -> Option<u64> {
    values(mapping, data).find(|(mapped, _)| mapped.address == address).map(|(_, value)| value)
}

/// Puts the value of one object into a PDO's data; its bits beyond the object's length are dropped. False where the PDO
/// does not have it.
pub fn put(mapping: &[Mapped], data: &mut [u8; 8], address: Address, value: u64) -> bool {
    let found = placed(mapping).find(|(mapped, _)| mapped.address == address);
    let Some((mapped, at)) = found.filter(|(mapped, at)| at.saturating_add(u32::from(mapped.bits)) <= 64)
    else {
        return false;
    };
    let mask = mask(mapped.bits).checked_shl(at).unwrap_or(0);
    let value = value.checked_shl(at).unwrap_or(0) & mask;
    *data = (u64::from_le_bytes(*data) & !mask | value).to_le_bytes();
    true
}
