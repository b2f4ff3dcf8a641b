//! Whose frame wins.

use puente_canopen::{Frame, Id};

/// The bits that decide who goes on, in their order on the bus: of two frames the lower one wins, 0 being dominant.
pub fn key(frame: &Frame) -> u32 {
    let remote = u32::from(frame.is_remote());
    match frame.id() {
        // 11 bits, RTR, IDE = 0.
        Id::Base(id) => u32::from(id) << 21 | remote << 20,
        // 11 bits, SRR = 1, IDE = 1, 18 bits, RTR.
        Id::Extended(id) => id >> 18 << 21 | 0b11 << 19 | (id & 0x3_FFFF) << 1 | remote,
    }
}

/// Where two frames of the same [`key`] differ first, in bits from the beginning without stuff bits: there both senders see an
/// error. To the byte, in the data.
pub fn first_difference(one: &Frame, other: &Frame) -> Option<u32> {
    // Start of frame, arbitration field, reserved bits; then the length, then the data.
    let head = match one.id() {
        Id::Base(_) => 1 + 13 + 1,
        Id::Extended(_) => 1 + 32 + 2,
    };
    if one.length() != other.length() {
        return Some(head + 4);
    }
    let different = one.data().iter().zip(other.data()).position(|(one, other)| one != other)?;
    Some(head + 4 + 8 * (different as u32 + 1))
}
