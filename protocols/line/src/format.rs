//! Baud rate and character format, and the times that follow from them.

use core::fmt;
use core::str::FromStr;
use core::time::Duration;

/// Parity bit of a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// No parity bit.
    None,
    /// Even parity.
    Even,
    /// Odd parity.
    Odd,
}

/// Data bits, parity and stop bits of a character, written as in `8E1`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// Data bits, 7 or 8.
    pub data_bits: u8,
    /// Parity bit.
    pub parity: Parity,
    /// Stop bits, 1 or 2.
    pub stop_bits: u8,
}

/// A text that is no character format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadFormat;

impl fmt::Display for BadFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected data bits 7 or 8, parity N, E or O, stop bits 1 or 2, as in 8E1")
    }
}

impl FromStr for Format {
    type Err = BadFormat;

    fn from_str(text: &str) -> Result<Self, BadFormat> {
        let [data, parity, stop] = text.as_bytes() else {
            return Err(BadFormat);
        };
        Ok(Self {
            data_bits: match data {
                b'7' => 7,
                b'8' => 8,
                _ => return Err(BadFormat),
            },
            parity: match parity {
                b'N' => Parity::None,
                b'E' => Parity::Even,
                b'O' => Parity::Odd,
                _ => return Err(BadFormat),
            },
            stop_bits: match stop {
                b'1' => 1,
                b'2' => 2,
                _ => return Err(BadFormat),
            },
        })
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parity = match self.parity {
            Parity::None => 'N',
            Parity::Even => 'E',
            Parity::Odd => 'O',
        };
        write!(f, "{}{}{}", self.data_bits, parity, self.stop_bits)
    }
}

impl Format {
    /// Bits of one character on the line: start, data, parity and stop bits.
    pub const fn bits(self) -> u32 {
        let parity = match self.parity {
            Parity::None => 0,
            Parity::Even | Parity::Odd => 1,
        };
        1 + self.data_bits as u32 + parity + self.stop_bits as u32
    }
}

/// Baud rate and character format of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Bits per second, at least 1.
    pub baud: u32,
    /// Character format.
    pub format: Format,
}

impl Settings {
    /// Time that `characters` take on the line without gaps, rounded up to a microsecond.
    pub fn wire_time(self, characters: usize) -> Duration {
        let bits = (characters as u64).saturating_mul(u64::from(self.format.bits()));
        Duration::from_micros(bits.saturating_mul(1_000_000).div_ceil(u64::from(self.baud.max(1))))
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn formats_read_and_print_alike() {
        for text in ["7N2", "7E1", "7O1", "8N2", "8E1", "8O1", "8N1"] {
            assert_eq!(text.parse::<Format>().map(|f| f.to_string()), Ok(text.to_string()));
        }
        for text in ["", "8", "8E", "9N1", "8e1", "8X1", "8E3", "8E11"] {
            assert_eq!(text.parse::<Format>(), Err(BadFormat), "{text}");
        }
    }

    #[test]
    fn wire_times_of_the_thesis() {
        // 17 characters of a Modbus ASCII request at 9600 8O1: 19.5 ms.
        let line = Settings { baud: 9600, format: "8O1".parse().expect("format") };
        assert_eq!(line.wire_time(17), Duration::from_micros(19_480));
        assert_eq!(line.wire_time(0), Duration::ZERO);
    }
}
