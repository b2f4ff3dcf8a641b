//! The two lamps of a CANopen device (CiA 303-3), as `led` shows them.

use core::fmt;

/// What a lamp shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamp {
    /// Nothing.
    Off,
    /// Light.
    On,
    /// One flash of 200 ms, then 1 s dark: the controller is near its limit of errors.
    Single,
    /// Two flashes, then 1 s dark: a node is missing.
    Double,
}

/// ms of a flash, and between two.
const FLASH: u32 = 200;
/// ms of dark after the flashes.
const PAUSE: u32 = 1000;

impl Lamp {
    const fn flashes(self) -> u32 {
        match self {
            Self::Single => 1,
            _ => 2,
        }
    }

    /// Whether it is lit at some moment, and for how many ms from then it stays so; none for ever.
    pub const fn at(self, ms: u32) -> (bool, Option<u32>) {
        match self {
            Self::Off => (false, None),
            Self::On => (true, None),
            Self::Single | Self::Double => {
                let lit_until = (2 * self.flashes() - 1) * FLASH;
                let period = lit_until + PAUSE;
                let at = ms % period;
                if at >= lit_until {
                    (false, Some(period - at))
                } else {
                    ((at / FLASH).is_multiple_of(2), Some(FLASH - at % FLASH))
                }
            }
        }
    }
}

/// The lamps as text. CR ends it, so that the next one stands in its place on a terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leds {
    /// The red one: errors.
    pub red: bool,
    /// The green one: the gateway's own NMT state.
    pub green: bool,
}

impl Leds {
    /// What takes their place when another command has come.
    pub const BLANK: &'static str = "                                   \r";
}

impl fmt::Display for Leds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lit = |on: bool| if on { '*' } else { ' ' };
        write!(f, " CANopen status LEDs: R{} G{}        \r", lit(self.red), lit(self.green))
    }
}
