//! A number as decimal text, as `core` writes it, but by tables that take a tenth of the room.

use core::fmt;

/// Shown as the shortest text without an exponent that reads as the number again; 0 where it is not finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decimal {
    negative: bool,
    /// Nine digits at most.
    digits: u32,
    /// Power of ten that they count in.
    exponent: i32,
}

impl From<f32> for Decimal {
    fn from(number: f32) -> Self {
        let number = if number.is_finite() { number } else { 0.0 };
        let mut buffer = ryu::Buffer::new();
        let text = buffer.format_finite(number);
        let (negative, text) = text.strip_prefix('-').map_or((false, text), |text| (true, text));
        let (mantissa, power) = text.split_once('e').unwrap_or((text, "0"));
        let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        let part = part.trim_end_matches('0');
        let digits = whole.bytes().chain(part.bytes()).fold(0_u64, |digits, digit| {
            digits.saturating_mul(10).saturating_add(u64::from(digit.saturating_sub(b'0')))
        });
        let exponent = power.parse().unwrap_or(0) - part.len() as i32;
        Self::normal(negative, digits, exponent)
    }
}

impl Decimal {
    /// Without zeros that say nothing.
    fn normal(negative: bool, mut digits: u64, mut exponent: i32) -> Self {
        while digits != 0 && digits.is_multiple_of(10) {
            digits /= 10;
            exponent += 1;
        }
        Self { negative, digits: digits.try_into().unwrap_or(u32::MAX), exponent }
    }

    /// The nearest with no more than so many decimals.
    pub fn rounded(self, decimals: u32) -> Self {
        let surplus = self.exponent.saturating_add_unsigned(decimals).min(0).unsigned_abs();
        let unit = 10_u64.checked_pow(surplus).unwrap_or(u64::MAX);
        let digits = (u64::from(self.digits) + unit / 2) / unit;
        Self::normal(self.negative, digits, self.exponent.saturating_add_unsigned(surplus))
    }
}

impl fmt::Display for Decimal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { negative, digits, exponent } = *self;
        f.write_str(if negative { "-" } else { "" })?;
        if digits == 0 || exponent >= 0 {
            write!(f, "{digits}")?;
            let zeros = if digits == 0 { 0 } else { exponent };
            return (0..zeros).try_for_each(|_| f.write_str("0"));
        }
        let decimals = exponent.unsigned_abs() as usize;
        match 10_u32.checked_pow(exponent.unsigned_abs()) {
            Some(unit) => write!(f, "{}.{:0decimals$}", digits / unit, digits % unit),
            None => write!(f, "0.{digits:0decimals$}"),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::format;
    use std::string::ToString;

    #[test]
    fn the_same_text_as_that_of_the_standard_library() {
        for number in [
            0.0,
            -0.0,
            1.0,
            -1.0,
            0.1,
            1e-3,
            1.5e-7,
            1e6,
            123_456.79,
            16_777_216.0,
            0.5,
            1e10,
            4.2e9,
            f32::MAX,
            f32::MIN_POSITIVE,
            1e-45,
            3.402_823_5e38,
            1.234_567_9e-30,
        ] {
            assert_eq!(Decimal::from(number).to_string(), format!("{number}"));
        }
        assert_eq!(Decimal::from(f32::NAN).to_string(), "0");
    }

    #[test]
    fn rounded() {
        for (number, decimals, text) in [
            (1.234_567_9e-5, 7, "0.0000123"),
            (0.999_96, 3, "1"),
            (-2.5, 0, "-3"),
            (0.05, 1, "0.1"),
            (0.05, 9, "0.05"),
            (1e-30, 7, "0"),
            (123.0, 0, "123"),
            (1e10, 2, "10000000000"),
        ] {
            assert_eq!(Decimal::from(number).rounded(decimals).to_string(), text);
        }
    }
}
