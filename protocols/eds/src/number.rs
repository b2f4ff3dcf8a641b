//! The numbers of a file.

use core::fmt;

use crate::DataType;

/// A number: sign and magnitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Number {
    /// It is below 0.
    pub negative: bool,
    /// The number without its sign.
    pub magnitude: u64,
}

impl Number {
    /// The number that a limit or value of a whole-numbered type is, on the node of that node-ID: `100`, `-5`, `0xFF`, and
    /// sums with `$NODEID`. A hexadecimal number that has a signed type's sign bit is below 0. None where it is no such.
    pub fn parse(text: &str, kind: DataType, node: u8) -> Option<Self> {
        let bits = 8 * u32::from(kind.size().filter(|_| kind.whole())?);
        let mut sum = None;
        for part in text.split('+') {
            let next = part_of(part.trim(), node)?;
            sum = Some(match sum {
                None => next,
                Some(Self { negative: false, magnitude }) if !next.negative => {
                    Self { negative: false, magnitude: magnitude.checked_add(next.magnitude)? }
                }
                Some(_) => return None,
            });
        }
        let number = sum?;
        let sign = 1u64.checked_shl(bits - 1)?;
        let over = number.magnitude.checked_shr(bits).is_some_and(|rest| rest > 0);
        match number {
            _ if over => None,
            Self { negative: true, magnitude } if !kind.signed() || magnitude > sign => None,
            Self { negative: false, magnitude } if kind.signed() && magnitude >= sign => {
                hexadecimal(text).then(|| Self { negative: true, magnitude: sign - (magnitude - sign) })
            }
            number => Some(number),
        }
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", if self.negative { "-" } else { "" }, self.magnitude)
    }
}

fn part_of(part: &str, node: u8) -> Option<Number> {
    if part.eq_ignore_ascii_case("$NODEID") {
        return Some(Number { negative: false, magnitude: node.into() });
    }
    let (negative, part) = match part.strip_prefix('-') {
        Some(rest) => (true, rest),
        None => (false, part),
    };
    let magnitude = unsigned(part)?;
    Some(Number { negative: negative && magnitude > 0, magnitude })
}

fn hexadecimal(text: &str) -> bool {
    text.contains(['x', 'X'])
}

/// A number without a sign, decimal or behind `0x`.
pub(crate) fn unsigned(text: &str) -> Option<u64> {
    let (digits, base) = match text.strip_prefix("0x").or_else(|| text.strip_prefix("0X")) {
        Some(digits) => (digits, 16),
        None => (text, 10),
    };
    // The library takes a sign.
    if digits.starts_with(['+', '-']) {
        return None;
    }
    u64::from_str_radix(digits, base).ok()
}
