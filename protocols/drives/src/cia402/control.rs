//! The controlword.

use super::Command;

/// Controlword (6040h). Bits 11 to 15 are the manufacturer's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Controlword(pub u16);

impl Controlword {
    /// Switch on.
    pub const SWITCH_ON: u16 = 1 << 0;
    /// Enable voltage.
    pub const ENABLE_VOLTAGE: u16 = 1 << 1;
    /// No quick stop: active low.
    pub const NO_QUICK_STOP: u16 = 1 << 2;
    /// Enable operation.
    pub const ENABLE_OPERATION: u16 = 1 << 3;
    /// Profile position: a new set-point. Homing: start. Interpolated position: interpolate.
    pub const MODE_4: u16 = 1 << 4;
    /// Profile position: the set-point counts at once, not after the last one.
    pub const IMMEDIATELY: u16 = 1 << 5;
    /// Profile position: the set-point is relative.
    pub const RELATIVE: u16 = 1 << 6;
    /// Fault reset, at its rising edge.
    pub const FAULT_RESET: u16 = 1 << 7;
    /// Halt.
    pub const HALT: u16 = 1 << 8;
    /// Profile position: go on to the set-point without a stop at the last one.
    pub const ON_SET_POINT: u16 = 1 << 9;
    /// What belongs to the mode, and halt.
    pub const OF_MODE: u16 =
        Self::MODE_4 | Self::IMMEDIATELY | Self::RELATIVE | Self::HALT | Self::ON_SET_POINT;

    /// The word that gives a command and nothing else. A fault reset is one only after a word without its bit.
    pub const fn of(command: Command) -> Self {
        Self(match command {
            Command::Shutdown => Self::ENABLE_VOLTAGE | Self::NO_QUICK_STOP,
            Command::SwitchOn => Self::SWITCH_ON | Self::ENABLE_VOLTAGE | Self::NO_QUICK_STOP,
            Command::EnableOperation => {
                Self::SWITCH_ON | Self::ENABLE_VOLTAGE | Self::NO_QUICK_STOP | Self::ENABLE_OPERATION
            }
            Command::DisableVoltage => 0,
            Command::QuickStop => Self::ENABLE_VOLTAGE,
            Command::FaultReset => Self::FAULT_RESET,
        })
    }

    /// With the mode's bits, see [`Controlword::OF_MODE`], in place of those it has; others are not taken.
    pub const fn with_mode(self, bits: u16) -> Self {
        Self(self.0 & !Self::OF_MODE | bits & Self::OF_MODE)
    }

    /// Whether all of these bits are set.
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// The command that a word gives to a drive whose last word was `last`.
    pub const fn command(self, last: Self) -> Command {
        if self.has(Self::FAULT_RESET) && last.0 & Self::FAULT_RESET == 0 {
            Command::FaultReset
        } else if !self.has(Self::ENABLE_VOLTAGE) {
            Command::DisableVoltage
        } else if !self.has(Self::NO_QUICK_STOP) {
            Command::QuickStop
        } else if !self.has(Self::SWITCH_ON) {
            Command::Shutdown
        } else if !self.has(Self::ENABLE_OPERATION) {
            Command::SwitchOn
        } else {
            Command::EnableOperation
        }
    }
}
