//! The statusword.

use core::fmt;

use super::State;

/// Statusword (6041h). Bits 8, 14 and 15 are the manufacturer's, 12 and 13 the mode's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statusword(pub u16);

impl Statusword {
    /// Voltage enabled: high voltage is there.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// Warning.
    pub const WARNING: u16 = 1 << 7;
    /// Remote: the controlword counts.
    pub const REMOTE: u16 = 1 << 9;
    /// Target reached; after a halt: it stands.
    pub const TARGET_REACHED: u16 = 1 << 10;
    /// Internal limit active.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// Profile position: set-point acknowledge. Homing: attained. Profile velocity: speed is 0. Interpolated position: active.
    /// Cyclic modes: the drive follows the command value.
    pub const MODE_12: u16 = 1 << 12;
    /// Position modes: following error. Homing: error. Profile velocity: slippage too high.
    pub const MODE_13: u16 = 1 << 13;

    const NAMES: [(u16, &'static str); 13] = [
        (1 << 0, "ready-to-switch-on"),
        (1 << 1, "switched-on"),
        (1 << 2, "operation-enabled"),
        (1 << 3, "fault"),
        (Self::VOLTAGE_ENABLED, "voltage-enabled"),
        (1 << 5, "no-quick-stop"),
        (1 << 6, "switch-on-disabled"),
        (Self::WARNING, "warning"),
        (Self::REMOTE, "remote"),
        (Self::TARGET_REACHED, "target-reached"),
        (Self::INTERNAL_LIMIT, "internal-limit"),
        (Self::MODE_12, "mode-12"),
        (Self::MODE_13, "mode-13"),
    ];

    /// The state that it tells; `None` where it tells none.
    pub fn state(self) -> Option<State> {
        State::from_status(self.0)
    }

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// The names of the bits that are set, from the lowest up, without those of the manufacturer.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(bit, _)| self.has(*bit)).map(|(_, name)| name)
    }
}

impl fmt::Display for Statusword {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.state() {
            Some(state) => state.fmt(f),
            None => write!(f, "{:04X}h, which is no state", self.0),
        }
    }
}
