//! Parameters by their names.

use core::fmt;
use core::str::FromStr;

/// A parameter, Pn000 to Pn765; its register address is its number (Pn037 is 0025h).
///
/// The thesis counts 222 parameters; the family's address range ends at 02FDh. A drive answers exception 02 for one
/// that it does not have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Parameter(u16);

/// What is known about a parameter. `None` where no source was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Info {
    /// What it sets.
    pub name: &'static str,
    /// Unit of the value.
    pub unit: Option<&'static str>,
    /// Smallest value that the drive takes.
    pub min: Option<u16>,
    /// Greatest value that the drive takes.
    pub max: Option<u16>,
    /// Value at delivery.
    pub default: Option<u16>,
}

/// A text that is no parameter name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadParameter;

impl fmt::Display for BadParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected a parameter from Pn000 to Pn765")
    }
}

impl core::error::Error for BadParameter {}

impl Parameter {
    /// Position error at which alarm 6 is raised; unit not found.
    pub const POSITION_ERROR: Self = Self(36);
    /// JOG speed, r/min (thesis figure 4.13).
    pub const JOG_SPEED: Self = Self(37);
    /// Station address. Pn210 to Pn216 take effect after the drive was off and on again (thesis table 4.3).
    pub const STATION: Self = Self(210);
    /// Baud rate: 0 = 4800, 1 = 9600, 2 = 19200.
    pub const BAUD: Self = Self(211);
    /// Frame: 0 to 5 = ASCII 7N2, 7E1, 7O1, 8N2, 8E1, 8O1; 6 to 8 = RTU 8N2, 8E1, 8O1.
    pub const FRAME: Self = Self(212);
    /// Protocol: 0 = RS-232, 1 = Modbus on RS-422 or RS-232, 2 = Modbus on RS-485.
    pub const PROTOCOL: Self = Self(213);
    /// Where the inputs come from, a bit each: 0 = terminals, 1 = network. Which bit is which input was not found.
    pub const INPUT_SOURCE: Self = Self(216);

    /// Parameter `number`; `None` beyond 765 (02FDh).
    pub const fn new(number: u16) -> Option<Self> {
        if number <= *super::register::PARAMETERS.end() { Some(Self(number)) } else { None }
    }

    /// The number in its name.
    pub const fn number(self) -> u16 {
        self.0
    }

    /// Its register address.
    pub const fn address(self) -> u16 {
        self.0
    }

    /// What the sources tell about it; `None` for a parameter whose meaning was not found.
    pub const fn info(self) -> Option<Info> {
        const fn ranged(name: &'static str, min: u16, max: u16, default: u16) -> Info {
            Info { name, unit: None, min: Some(min), max: Some(max), default: Some(default) }
        }
        const fn named(name: &'static str, unit: Option<&'static str>) -> Info {
            Info { name, unit, min: None, max: None, default: None }
        }
        Some(match self {
            Self::POSITION_ERROR => named("position error threshold", None),
            Self::JOG_SPEED => named("JOG speed", Some("r/min")),
            Self::STATION => ranged("station address", 1, 255, 1),
            Self::BAUD => ranged("baud rate", 0, 2, 1),
            Self::FRAME => ranged("frame format", 0, 8, 5),
            Self::PROTOCOL => ranged("protocol", 0, 2, 2),
            Self::INPUT_SOURCE => ranged("input source", 0, 255, 0),
            _ => return None,
        })
    }
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Pn{:03}", self.0)
    }
}

impl FromStr for Parameter {
    type Err = BadParameter;

    /// Reads `Pn` in any case and exactly three digits.
    fn from_str(text: &str) -> Result<Self, BadParameter> {
        let [b'P' | b'p', b'N' | b'n', digits @ ..] = text.as_bytes() else {
            return Err(BadParameter);
        };
        if digits.len() != 3 || !digits.iter().all(u8::is_ascii_digit) {
            return Err(BadParameter);
        }
        let number = digits.iter().fold(0, |number, digit| number * 10 + u16::from(digit - b'0'));
        Self::new(number).ok_or(BadParameter)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    #[test]
    fn names() {
        for text in ["Pn037", "pn037", "PN037", "pN037"] {
            assert_eq!(text.parse(), Ok(Parameter::JOG_SPEED), "{text}");
        }
        assert_eq!(Parameter::JOG_SPEED.address(), 0x0025);
        assert_eq!("Pn765".parse(), Ok(Parameter(0x02FD)));
        for text in [
            "", "Pn", "Pn37", "Pn0037", "Pn766", "Pn999", "Pn-37", "Pn+37", "Pn03a", " Pn037", "037", "Pñ037",
        ] {
            assert_eq!(text.parse::<Parameter>(), Err(BadParameter), "{text}");
        }
        assert_eq!(Parameter::new(0x02FE), None);
    }

    #[test]
    fn only_what_a_source_tells() {
        let jog = Parameter::JOG_SPEED.info().expect("known");
        assert_eq!((jog.unit, jog.min, jog.max, jog.default), (Some("r/min"), None, None, None));
        let frame = Parameter::FRAME.info().expect("known");
        assert_eq!((frame.min, frame.max, frame.default), (Some(0), Some(8), Some(5)));
        let known = (0..=765).filter_map(Parameter::new).filter(|parameter| parameter.info().is_some());
        assert!(known.map(Parameter::number).eq([36, 37, 210, 211, 212, 213, 216]));
    }

    proptest! {
        #[test]
        fn names_round_trip(number in 0..=765_u16) {
            let parameter = Parameter::new(number).expect("in range");
            prop_assert_eq!(parameter.to_string().parse(), Ok(parameter));
        }

        #[test]
        fn any_text_is_read_without_panic(text in ".*") {
            if let Ok(parameter) = text.parse::<Parameter>() {
                prop_assert!(parameter.to_string().eq_ignore_ascii_case(&text));
            }
        }
    }
}
