//! The words of a text.

use puente_canopen::{Frame, Id, frame};

/// Words between spaces, however many.
pub fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// A number in decimal digits.
pub fn decimal(word: &[u8]) -> Option<u32> {
    number(word, 10)
}

/// A number in hexadecimal digits of either case.
pub fn hexadecimal(word: &[u8]) -> Option<u32> {
    number(word, 16)
}

fn number(word: &[u8], base: u32) -> Option<u32> {
    if word.is_empty() {
        return None;
    }
    word.iter().try_fold(0u32, |value, digit| {
        let digit = char::from(*digit).to_digit(base)?;
        value.checked_mul(base)?.checked_add(digit)
    })
}

/// A byte in one or two hexadecimal digits.
pub fn byte(word: &[u8]) -> Option<u8> {
    hexadecimal(word)?.try_into().ok()
}

/// An identifier: eight digits are an extended one, fewer a base one.
pub fn id(word: &[u8]) -> Option<Id> {
    let value = hexadecimal(word)?;
    match word.len() {
        8 if value <= frame::MAX_EXTENDED => Some(Id::extended(value)),
        1..8 if value <= frame::MAX_BASE.into() => Some(Id::base(value as u16)),
        _ => None,
    }
}

/// `id dlc [byte]*`, and nothing after it.
pub fn frame<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> Option<Frame> {
    let id = id(words.next()?)?;
    let length = usize::try_from(decimal(words.next()?)?).ok()?;
    let mut data = [0; frame::MAX_DATA];
    for place in data.get_mut(..length)? {
        *place = byte(words.next()?)?;
    }
    if words.next().is_some() {
        return None;
    }
    Frame::new(id, data.get(..length)?)
}
