//! Text to bytes.

use heapless::Vec;

use super::DataType;
use crate::number;

/// Longest number.
const MAX_NUMBER: usize = 40;

/// The text is no value of the type, or something follows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadValue;

/// Reads a value that ends with its line, character by character: what it is needs no more room than a number.
#[derive(Clone, Debug)]
pub struct Decoder {
    kind: DataType,
    state: State,
    /// A number as far as it has come; of hex and base64 the digits that make no byte yet.
    held: Vec<u8, MAX_NUMBER>,
    /// There is a byte, or a number.
    any: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Nothing has come.
    Start,
    /// In the value.
    Inside,
    /// In a text between quotes.
    Quoted,
    /// A quote in such a text: its end, or half of a quote that is meant.
    Quote,
    /// The same in a text without quotes, where it can only be meant.
    BareQuote,
    /// Behind the padding of base64.
    Padding,
    /// Behind the value.
    Behind,
    /// In a comment.
    Comment,
}

impl Decoder {
    /// One for a value of this type.
    pub const fn new(kind: DataType) -> Self {
        Self { kind, state: State::Start, held: Vec::new(), any: false }
    }

    /// Takes the next character of the line; the bytes that have become whole by it go out, in their order in the object.
    ///
    /// # Errors
    /// `BadValue`: nothing must follow.
    pub fn push(&mut self, byte: u8, mut out: impl FnMut(u8)) -> Result<(), BadValue> {
        let graphic = byte.is_ascii_graphic();
        match self.state {
            State::Comment => Ok(()),
            State::Start if byte == b'#' => Err(BadValue),
            State::Start if !graphic && (self.kind != DataType::Text || byte.is_ascii()) => Ok(()),
            State::Start | State::Inside => match self.kind {
                DataType::Hex => self.hex(byte, graphic, &mut out),
                DataType::Text => self.bare(byte, &mut out),
                DataType::Base64 => self.base64(byte, graphic, &mut out),
                _ => self.number(byte, graphic),
            },
            State::Quoted if byte == b'"' => self.go(State::Quote),
            State::Quoted => self.give(byte, &mut out),
            State::Quote if byte == b'"' => {
                self.state = State::Quoted;
                self.give(byte, &mut out)
            }
            State::BareQuote if byte == b'"' => {
                self.state = State::Inside;
                self.give(byte, &mut out)
            }
            State::BareQuote => Err(BadValue),
            State::Padding if byte == b'=' => Ok(()),
            State::Behind | State::Padding if byte == b'#' => self.go(State::Comment),
            State::Quote if graphic => Err(BadValue),
            State::Behind | State::Padding if graphic => Err(BadValue),
            State::Quote | State::Behind | State::Padding => self.go(State::Behind),
        }
    }

    /// The line has ended.
    ///
    /// # Errors
    /// `BadValue`: the value is not whole, or there is none.
    pub fn end(mut self, mut out: impl FnMut(u8)) -> Result<(), BadValue> {
        match (self.kind, self.state) {
            (_, State::Start | State::Quoted | State::BareQuote) => return Err(BadValue),
            (DataType::Hex, _) => self.hex_byte(&mut out)?,
            (DataType::Base64, State::Inside) => self.last_digits(&mut out)?,
            (DataType::Base64 | DataType::Text, _) => {}
            _ => self.whole_number(&mut out)?,
        }
        if self.any { Ok(()) } else { Err(BadValue) }
    }

    fn go(&mut self, state: State) -> Result<(), BadValue> {
        self.state = state;
        Ok(())
    }

    fn give(&mut self, byte: u8, out: &mut impl FnMut(u8)) -> Result<(), BadValue> {
        self.any = true;
        out(byte);
        Ok(())
    }

    fn hold(&mut self, digit: u8) -> Result<(), BadValue> {
        self.state = State::Inside;
        self.held.push(digit).map_err(|_| BadValue)
    }

    /// Digits in pairs; a single one before a space is a byte, too.
    fn hex(&mut self, byte: u8, graphic: bool, out: &mut impl FnMut(u8)) -> Result<(), BadValue> {
        match char::from(byte).to_digit(16) {
            Some(digit) => {
                self.hold(digit as u8)?;
                if self.held.len() == 2 { self.hex_byte(out) } else { Ok(()) }
            }
            None if byte == b'#' => {
                self.hex_byte(out)?;
                self.go(State::Comment)
            }
            None if graphic => Err(BadValue),
            None => self.hex_byte(out),
        }
    }

    fn hex_byte(&mut self, out: &mut impl FnMut(u8)) -> Result<(), BadValue> {
        if self.held.is_empty() {
            return Ok(());
        }
        let byte = self.held.iter().fold(0, |byte, digit| byte << 4 | digit);
        self.held.clear();
        self.give(byte, out)
    }

    /// A single word, or the quote that begins a text.
    fn bare(&mut self, byte: u8, out: &mut impl FnMut(u8)) -> Result<(), BadValue> {
        match (byte, self.state) {
            (b'"', State::Start) => self.go(State::Quoted),
            (b'"', _) => self.go(State::BareQuote),
            (byte, _) if byte.is_ascii_graphic() || !byte.is_ascii() => {
                self.state = State::Inside;
                self.give(byte, out)
            }
            _ => self.go(State::Behind),
        }
    }

    fn base64(&mut self, byte: u8, graphic: bool, out: &mut impl FnMut(u8)) -> Result<(), BadValue> {
        let digit = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            b'=' => {
                self.last_digits(out)?;
                return self.go(State::Padding);
            }
            b'#' => {
                self.last_digits(out)?;
                return self.go(State::Comment);
            }
            _ if graphic => return Err(BadValue),
            _ => {
                self.last_digits(out)?;
                return self.go(State::Behind);
            }
        };
        self.hold(digit)?;
        if self.held.len() == 4 { self.digits(3, out) } else { Ok(()) }
    }

    /// Two or three digits at the end of base64 are one or two bytes, one is none.
    fn last_digits(&mut self, out: &mut impl FnMut(u8)) -> Result<(), BadValue> {
        match self.held.len() {
            0 => Ok(()),
            1 => Err(BadValue),
            digits => self.digits(digits - 1, out),
        }
    }

    fn digits(&mut self, bytes: usize, out: &mut impl FnMut(u8)) -> Result<(), BadValue> {
        let word = self.held.iter().fold(0u32, |word, digit| word << 6 | u32::from(*digit));
        let word = word << (6 * 4usize.saturating_sub(self.held.len()));
        self.held.clear();
        let [_, whole @ ..] = word.to_be_bytes();
        whole.into_iter().take(bytes).try_for_each(|byte| self.give(byte, out))
    }

    fn number(&mut self, byte: u8, graphic: bool) -> Result<(), BadValue> {
        match byte {
            b'#' => self.go(State::Comment),
            _ if graphic => self.hold(byte),
            _ => self.go(State::Behind),
        }
    }

    fn whole_number(&mut self, out: &mut impl FnMut(u8)) -> Result<(), BadValue> {
        let size = self.kind.size().unwrap_or_default();
        let bits = 8 * u32::from(size);
        let bytes = match self.kind {
            DataType::Signed(_) => {
                let number = number::signed(&self.held).ok_or(BadValue)?;
                // Nothing but its sign is cut off.
                let fits = number >> bits.saturating_sub(1).min(63);
                if fits != 0 && fits != -1 {
                    return Err(BadValue);
                }
                number.to_le_bytes()
            }
            DataType::Real(4) => {
                let [a, b, c, d] = super::real::parse::<f32>(&self.held).ok_or(BadValue)?.to_le_bytes();
                [a, b, c, d, 0, 0, 0, 0]
            }
            DataType::Real(_) => super::real::parse::<f64>(&self.held).ok_or(BadValue)?.to_le_bytes(),
            _ => {
                let number = number::unsigned(&self.held).ok_or(BadValue)?;
                if number.checked_shr(bits).unwrap_or_default() != 0 {
                    return Err(BadValue);
                }
                number.to_le_bytes()
            }
        };
        bytes.into_iter().take(usize::from(size)).try_for_each(|byte| self.give(byte, out))
    }
}
