//! The commands of the state machine, and where they lead.

use super::State;

/// What a controlword tells the state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Shutdown.
    Shutdown,
    /// Switch on; to a drive under current: disable operation.
    SwitchOn,
    /// Enable operation.
    EnableOperation,
    /// Disable voltage.
    DisableVoltage,
    /// Quick stop.
    QuickStop,
    /// Fault reset: the rising edge of its bit.
    FaultReset,
}

impl Command {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Shutdown,
        Self::SwitchOn,
        Self::EnableOperation,
        Self::DisableVoltage,
        Self::QuickStop,
        Self::FaultReset,
    ];
}

/// A transition that a command brings about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transition {
    /// Its number in CiA 402.
    pub number: u8,
    /// Where it leads.
    pub to: State,
}

/// What a command brings about in a state; `None` where it brings about nothing. 0, 1, 13 and 14 the drive does by itself,
/// and 12 too, where its quick stop option says so.
pub const fn transition(state: State, command: Command) -> Option<Transition> {
    let (number, to) = match (state, command) {
        (State::SwitchOnDisabled, Command::Shutdown) => (2, State::ReadyToSwitchOn),
        (State::ReadyToSwitchOn, Command::SwitchOn) => (3, State::SwitchedOn),
        (State::SwitchedOn, Command::EnableOperation) => (4, State::OperationEnabled),
        (State::OperationEnabled, Command::SwitchOn) => (5, State::SwitchedOn),
        (State::SwitchedOn, Command::Shutdown) => (6, State::ReadyToSwitchOn),
        (State::ReadyToSwitchOn, Command::DisableVoltage | Command::QuickStop) => {
            (7, State::SwitchOnDisabled)
        }
        (State::OperationEnabled, Command::Shutdown) => (8, State::ReadyToSwitchOn),
        (State::OperationEnabled, Command::DisableVoltage) => (9, State::SwitchOnDisabled),
        (State::SwitchedOn, Command::DisableVoltage | Command::QuickStop) => (10, State::SwitchOnDisabled),
        (State::OperationEnabled, Command::QuickStop) => (11, State::QuickStopActive),
        (State::QuickStopActive, Command::DisableVoltage) => (12, State::SwitchOnDisabled),
        (State::Fault, Command::FaultReset) => (15, State::SwitchOnDisabled),
        (State::QuickStopActive, Command::EnableOperation) => (16, State::OperationEnabled),
        _ => return None,
    };
    Some(Transition { number, to })
}
