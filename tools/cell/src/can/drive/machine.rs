//! The power drive state machine, from the drive's side (CiA 402).

use puente_drives::cia402::State;

/// What a controlword asks of the state machine, by its bits 0 to 3 and the edge of bit 7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// xxxx x110
    Shutdown,
    /// xxxx 0111
    SwitchOn,
    /// xxxx 1111
    EnableOperation,
    /// xxxx xx0x
    DisableVoltage,
    /// xxxx x01x
    QuickStop,
}

/// What a controlword asks, its fault reset apart.
pub fn ask(control: u16) -> Ask {
    match control & 0b1111 {
        low if low & 0b0010 == 0 => Ask::DisableVoltage,
        low if low & 0b0100 == 0 => Ask::QuickStop,
        low if low & 0b0001 == 0 => Ask::Shutdown,
        0b0111 => Ask::SwitchOn,
        _ => Ask::EnableOperation,
    }
}

/// What a drive does about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turn {
    /// Nothing.
    Stay,
    /// It is in another state at once: transitions 2, 3, 6, 7, 10, 12 and 16.
    Go(State),
    /// It goes under current: transition 4.
    Enable,
    /// It stops as its option code says, and then is in another state: 5 (disable operation) and 8 (shutdown).
    Stop(State),
    /// It drops its current: 9.
    Drop,
    /// It stops as its option code says: 11.
    QuickStop,
}

/// What a drive in a state does about what it is asked.
pub fn turn(state: State, ask: Ask) -> Turn {
    use State::{OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    match (state, ask) {
        (SwitchOnDisabled, Ask::Shutdown) | (SwitchedOn, Ask::Shutdown) => Turn::Go(ReadyToSwitchOn),
        (ReadyToSwitchOn, Ask::SwitchOn) => Turn::Go(SwitchedOn),
        (SwitchedOn, Ask::EnableOperation) => Turn::Enable,
        (ReadyToSwitchOn | SwitchedOn, Ask::DisableVoltage | Ask::QuickStop) => Turn::Go(SwitchOnDisabled),
        (QuickStopActive, Ask::DisableVoltage) => Turn::Go(SwitchOnDisabled),
        (QuickStopActive, Ask::EnableOperation) => Turn::Go(OperationEnabled),
        (OperationEnabled, Ask::SwitchOn) => Turn::Stop(SwitchedOn),
        (OperationEnabled, Ask::Shutdown) => Turn::Stop(ReadyToSwitchOn),
        (OperationEnabled, Ask::DisableVoltage) => Turn::Drop,
        (OperationEnabled, Ask::QuickStop) => Turn::QuickStop,
        _ => Turn::Stay,
    }
}
