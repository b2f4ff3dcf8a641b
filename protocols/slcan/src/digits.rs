//! Hexadecimal digits, and the frames made of them.

use puente_canopen::{Frame, Id, frame};

use crate::lines::Text;

/// Data bytes of the longest frame.
const MAX_DATA: u8 = frame::MAX_DATA as u8;

/// The value of hexadecimal digits of either case, 8 at most; `None` where there are none, or other characters.
pub fn value(digits: &[u8]) -> Option<u32> {
    if digits.is_empty() || digits.len() > 8 {
        return None;
    }
    digits.iter().try_fold(0, |value, digit| Some(value << 4 | char::from(*digit).to_digit(16)?))
}

/// Writes so many upper-case digits of a value. What there is no room for is dropped; [`Text`] has room for all lines.
pub fn push(text: &mut Text, value: u32, digits: u32) {
    for at in (0..digits).rev() {
        let digit = (value >> (4 * at) & 0xF) as u8;
        let _ = text.push(if digit < 10 { b'0' + digit } else { b'A' + digit - 10 });
    }
}

/// The value of decimal digits; `None` where there are other characters.
pub fn decimal(digits: &[u8]) -> Option<u16> {
    digits.iter().try_fold(0_u16, |value, digit| {
        value.checked_mul(10)?.checked_add(char::from(*digit).to_digit(10)? as u16)
    })
}

/// Writes three decimal digits of a value, 999 at most.
pub fn push_decimal(text: &mut Text, value: u16) {
    let value = value.min(999);
    for place in [100, 10, 1] {
        let _ = text.push(b'0' + (value / place % 10) as u8);
    }
}

/// A frame by its line, and what follows it there. A data length code of 9 to F counts as 8 (ISO 11898-1).
pub fn frame(line: &[u8]) -> Option<(Frame, &[u8])> {
    let (kind, rest) = line.split_first()?;
    // CANDapter's adapters have `x` for `T`.
    let (extended, remote) = match kind {
        b't' => (false, false),
        b'T' | b'x' => (true, false),
        b'r' => (false, true),
        b'R' => (true, true),
        _ => return None,
    };
    let (id, rest) = rest.split_at_checked(if extended { 8 } else { 3 })?;
    let id = value(id)?;
    let id = match extended {
        false if id <= frame::MAX_BASE.into() => Id::base(id as u16),
        true if id <= frame::MAX_EXTENDED => Id::extended(id),
        _ => return None,
    };
    let (length, rest) = rest.split_at_checked(1)?;
    let length = (value(length)? as u8).min(MAX_DATA);
    if remote {
        return Some((Frame::remote(id, length), rest));
    }
    let (digits, rest) = rest.split_at_checked(2 * usize::from(length))?;
    let mut data = [0; frame::MAX_DATA];
    for (byte, digits) in data.iter_mut().zip(digits.chunks(2)) {
        *byte = value(digits)? as u8;
    }
    Some((Frame::new(id, data.get(..length.into())?)?, rest))
}

/// Writes a frame without the end of its line.
pub fn push_frame(text: &mut Text, frame: &Frame) {
    let (kind, digits) = match (frame.id(), frame.is_remote()) {
        (Id::Base(_), false) => (b't', 3),
        (Id::Extended(_), false) => (b'T', 8),
        (Id::Base(_), true) => (b'r', 3),
        (Id::Extended(_), true) => (b'R', 8),
    };
    let _ = text.push(kind);
    push(text, frame.id().raw(), digits);
    push(text, frame.length().into(), 1);
    for byte in frame.data() {
        push(text, (*byte).into(), 2);
    }
}
