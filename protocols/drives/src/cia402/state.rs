//! The states of the power drive state machine.

use core::fmt;

/// State of a drive, as its statusword tells it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Not ready to switch on: it initialises itself.
    NotReadyToSwitchOn,
    /// Switch on disabled: ready for parameters, no high voltage.
    SwitchOnDisabled,
    /// Ready to switch on: high voltage may be there, no current.
    ReadyToSwitchOn,
    /// Switched on: high voltage is there, no current.
    SwitchedOn,
    /// Operation enabled: under current.
    OperationEnabled,
    /// Quick stop active: it stops, or has stopped and is held.
    QuickStopActive,
    /// Fault reaction active: a fault is being reacted to.
    FaultReactionActive,
    /// Fault: no current, until it is reset.
    Fault,
}

impl State {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::NotReadyToSwitchOn,
        Self::SwitchOnDisabled,
        Self::ReadyToSwitchOn,
        Self::SwitchedOn,
        Self::OperationEnabled,
        Self::QuickStopActive,
        Self::FaultReactionActive,
        Self::Fault,
    ];

    /// The bits of a statusword that tell it, and their values.
    pub const fn pattern(self) -> (u16, u16) {
        match self {
            Self::NotReadyToSwitchOn => (0x4F, 0x00),
            Self::SwitchOnDisabled => (0x4F, 0x40),
            Self::ReadyToSwitchOn => (0x6F, 0x21),
            Self::SwitchedOn => (0x6F, 0x23),
            Self::OperationEnabled => (0x6F, 0x27),
            Self::QuickStopActive => (0x6F, 0x07),
            Self::FaultReactionActive => (0x4F, 0x0F),
            Self::Fault => (0x4F, 0x08),
        }
    }

    /// The state that a statusword tells; `None` where it tells none.
    pub fn from_status(word: u16) -> Option<Self> {
        Self::ALL.into_iter().find(|state| {
            let (mask, value) = state.pattern();
            word & mask == value
        })
    }

    /// Whether the motor may be under current.
    pub const fn is_powered(self) -> bool {
        matches!(self, Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive)
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotReadyToSwitchOn => "not ready to switch on",
            Self::SwitchOnDisabled => "switch on disabled",
            Self::ReadyToSwitchOn => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::OperationEnabled => "operation enabled",
            Self::QuickStopActive => "quick stop active",
            Self::FaultReactionActive => "fault reaction active",
            Self::Fault => "fault",
        })
    }
}
