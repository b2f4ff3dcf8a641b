//! DAT for a module: Kp, Ki, Kd and set-point, in this order, then the [`Order`].
//!
//! The order and the text of the four are those of the thesis' `GetData` and `extractData` (its prose names Kd before Ki).
//! A length is the character `0` plus the number of characters that follow, as `GetData` has it, which takes 48 off. The
//! [`Order`] is this project's: in text a fifth value of one digit, in binary that digit alone. Frames of the thesis have
//! none. Zeros may follow the values, since the thesis sends sections of 255 bytes whatever is in them (assumed).

use core::fmt::{self, Write};

use heapless::Vec;
use puente_drives::pid::Gains;

use crate::{Decimal, Order};

/// Characters of the longest number: with more, the thesis' buffer of 10 would have no room for the end of its string.
pub const MAX_DIGITS: usize = 9;
/// Bytes of the longest DAT that we send.
pub const MAX_DATA: usize = 4 * (1 + MAX_DIGITS) + 2;
/// The furthest set-point either way, counts: an f32 has all whole numbers up to here.
pub const MAX_SET_POINT: i32 = 1 << 24;

/// How the values are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// Each as decimal text, its length before it: `4` `12.5`.
    #[default]
    Text,
    /// Four `f32`, big-endian.
    Binary,
}

/// What a section says to a module.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setting {
    /// Proportional gain.
    pub kp: f32,
    /// Integral gain.
    pub ki: f32,
    /// Derivative gain.
    pub kd: f32,
    /// Position to go to, in counts of the encoder.
    pub set_point: f32,
    /// What the module shall be at; none in frames of the thesis.
    pub order: Option<Order>,
}

/// Why data are no setting, or a setting cannot be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataError {
    /// The data end before the fourth value.
    TooShort,
    /// A length is not `1` to `9`.
    Length {
        /// Which value, from 0 on.
        value: u8,
        /// The byte in the length's place.
        received: u8,
    },
    /// A value is not a finite decimal number.
    Number {
        /// Which value, from 0 on.
        value: u8,
    },
    /// The fifth value is no order, or something other than zeros follows the values.
    Surplus,
    /// Nine characters do not hold the value to three digits.
    Precision {
        /// Which value, from 0 on.
        value: u8,
    },
}

impl fmt::Display for DataError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const NAMES: [&str; 4] = ["Kp", "Ki", "Kd", "the set-point"];
        let name = |value: &u8| NAMES.get(usize::from(*value)).copied().unwrap_or("a value");
        match self {
            Self::TooShort => f.write_str("the data end before the set-point"),
            Self::Length { value, received } => {
                write!(f, "the length of {} is {received:02X}h; expected `1` to `9`", name(value))
            }
            Self::Number { value } => write!(f, "{} is no finite decimal number", name(value)),
            Self::Surplus => f.write_str("what follows the set-point is no order, or more"),
            Self::Precision { value } => write!(f, "9 characters do not hold {}", name(value)),
        }
    }
}

impl core::error::Error for DataError {}

impl Setting {
    /// Reads DAT.
    ///
    /// # Errors
    /// Any [`DataError`] but `Precision`.
    pub fn parse(form: Form, data: &[u8]) -> Result<Self, DataError> {
        let mut values = [0.0; 4];
        let mut rest = data;
        for (value, place) in (0..).zip(&mut values) {
            (*place, rest) = match form {
                Form::Text => text(value, rest)?,
                Form::Binary => binary(value, rest)?,
            };
        }
        let (order, rest) = match (form, rest) {
            (_, [] | [0, ..]) => (None, rest),
            (Form::Text, [b'1', digit, rest @ ..]) | (Form::Binary, [digit, rest @ ..]) => {
                (Some(Order::from_digit(*digit).ok_or(DataError::Surplus)?), rest)
            }
            _ => return Err(DataError::Surplus),
        };
        if rest.iter().any(|byte| *byte != 0) {
            return Err(DataError::Surplus);
        }
        let [kp, ki, kd, set_point] = values;
        Ok(Self { kp, ki, kd, set_point, order })
    }

    /// Writes DAT.
    ///
    /// # Errors
    /// `Number` where a value is not finite; `Precision` where its text would be off by more than a thousandth, as that
    /// of 0.000000012 or of 1e10.
    pub fn emit(&self, form: Form) -> Result<Vec<u8, MAX_DATA>, DataError> {
        let mut data = Vec::new();
        for (value, number) in (0..).zip([self.kp, self.ki, self.kd, self.set_point]) {
            push(&mut data, form, value, number)?;
        }
        if let Some(order) = self.order {
            push_order(&mut data, form, order);
        }
        Ok(data)
    }

    /// The set-point as whole counts, to the nearest; `None` beyond [`MAX_SET_POINT`].
    pub fn counts(&self) -> Option<i32> {
        let most = MAX_SET_POINT as f32;
        if !(-most..=most).contains(&self.set_point) {
            return None;
        }
        let whole = self.set_point as i32;
        let part = self.set_point - whole as f32;
        Some(whole + i32::from(part >= 0.5) - i32::from(part <= -0.5))
    }
}

/// Whether gains can be written, to a thousandth in [`Form::Text`].
///
/// # Errors
/// `Precision`, see [`Setting::emit`].
pub fn check(form: Form, gains: Gains) -> Result<(), DataError> {
    let mut data = Vec::new();
    push_gains(&mut data, form, gains)
}

/// Appends Kp, Ki, Kd.
pub(crate) fn push_gains(data: &mut Vec<u8, MAX_DATA>, form: Form, gains: Gains) -> Result<(), DataError> {
    let numbers = [gains.kp(), gains.ki(), gains.kd()];
    (0..).zip(numbers).try_for_each(|(value, number)| push(data, form, value, number))
}

/// Appends what follows the gains.
pub(crate) fn push_rest(data: &mut Vec<u8, MAX_DATA>, form: Form, set_point: i32, order: Order) {
    let set_point = set_point.clamp(-MAX_SET_POINT, MAX_SET_POINT);
    // It has at most nine characters, and is finite.
    let _ = match form {
        Form::Text => push_digits(data, set_point).ok_or(DataError::Number { value: 3 }),
        Form::Binary => push(data, form, 3, set_point as f32),
    };
    push_order(data, form, order);
}

// MAX_DATA bytes hold the four values and the order in either form, so that nothing is refused.

fn push(data: &mut Vec<u8, MAX_DATA>, form: Form, value: u8, number: f32) -> Result<(), DataError> {
    if !number.is_finite() {
        return Err(DataError::Number { value });
    }
    match form {
        Form::Text => {
            let digits = digits(number).ok_or(DataError::Precision { value })?;
            push_digits(data, digits).ok_or(DataError::Precision { value })
        }
        Form::Binary => {
            let _ = data.extend_from_slice(&number.to_be_bytes());
            Ok(())
        }
    }
}

/// A length and its digits.
fn push_digits(data: &mut Vec<u8, MAX_DATA>, digits: impl fmt::Display) -> Option<()> {
    let mut text = heapless::String::<MAX_DIGITS>::new();
    write!(text, "{digits}").ok()?;
    let _ = data.push(b'0' + text.len() as u8);
    let _ = data.extend_from_slice(text.as_bytes());
    Some(())
}

fn push_order(data: &mut Vec<u8, MAX_DATA>, form: Form, order: Order) {
    if form == Form::Text {
        let _ = data.push(b'1');
    }
    let _ = data.push(order.digit());
}

fn text(value: u8, data: &[u8]) -> Result<(f32, &[u8]), DataError> {
    let (&length, rest) = data.split_first().ok_or(DataError::TooShort)?;
    let count = match length {
        b'1'..=b'9' => usize::from(length - b'0'),
        _ => return Err(DataError::Length { value, received: length }),
    };
    let (digits, rest) = rest.split_at_checked(count).ok_or(DataError::TooShort)?;
    let number = number(digits).ok_or(DataError::Number { value })?;
    Ok((number, rest))
}

fn number(digits: &[u8]) -> Option<f32> {
    // Not all that `f32` reads is decimal: `inf`, `nan`.
    let decimal = |byte: &u8| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E');
    let digits = core::str::from_utf8(digits).ok().filter(|digits| digits.bytes().all(|b| decimal(&b)))?;
    digits.parse().ok().filter(|number: &f32| number.is_finite())
}

fn binary(value: u8, data: &[u8]) -> Result<(f32, &[u8]), DataError> {
    let (&bytes, rest) = data.split_first_chunk().ok_or(DataError::TooShort)?;
    let number = f32::from_be_bytes(bytes);
    if number.is_finite() { Ok((number, rest)) } else { Err(DataError::Number { value }) }
}

/// The shortest text that reads as `number` again; where that is too long, the closest one.
fn digits(number: f32) -> Option<heapless::String<MAX_DIGITS>> {
    let mut text = heapless::String::new();
    let decimal = Decimal::from(number);
    if write!(text, "{decimal}").is_ok() {
        return Some(text);
    }
    (0..MAX_DIGITS as u32).rev().find_map(|places| {
        text.clear();
        write!(text, "{}", decimal.rounded(places)).ok()?;
        let written: f32 = text.parse().ok()?;
        let error = (written - number).abs();
        (error <= number.abs() * 1e-3).then(|| text.clone())
    })
}
