//! What a module is told, and what it tells.

use core::fmt;

use super::{EncoderFault, Gains};

/// What the bus asks of a module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// New gains, at once and in every state. They act without a step only while the error is 0; the slew limit softens
    /// what remains.
    Gains(Gains),
    /// Where to go, counts. While an axis is enabled, set-points must keep coming, be they new or not.
    SetPoint(i64),
    /// Puts the amplifier under current and holds the axis where it is; or ends a stop.
    Enable,
    /// Takes the amplifier's current away; acknowledges a fault.
    Disable,
    /// Holds the axis where it is, and takes no set-point until it is enabled again. An axis in motion goes on for as long
    /// as the amplifier takes to brake it, and comes back.
    Stop,
}

/// Why a command was not carried out. Nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// Not in this state: a set-point unless enabled, an enable in a fault.
    State(State),
    /// An enable without a position.
    Encoder(EncoderFault),
    /// A Kp of 0 and an axis under current do not go together: it would not be held.
    Gains,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::State(State::Fault(cause)) => write!(f, "fault: {cause}; disable the axis first"),
            Self::State(state) => write!(f, "the axis is {state}; enable it first"),
            Self::Encoder(fault) => write!(f, "no position: {fault}"),
            Self::Gains => f.write_str("Kp is 0: the axis would not be held"),
        }
    }
}

/// What a module is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// No current, command 0.
    Disabled,
    /// The amplifier is being enabled: command 0, its fault line not looked at.
    Starting,
    /// The loop follows the set-points.
    Enabled,
    /// The loop holds the axis after a stop.
    Held,
    /// No current, command 0, until it is acknowledged by [`Command::Disable`].
    Fault(Cause),
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Disabled => f.write_str("disabled"),
            Self::Starting => f.write_str("starting"),
            Self::Enabled => f.write_str("enabled"),
            Self::Held => f.write_str("held"),
            Self::Fault(cause) => write!(f, "in fault: {cause}"),
        }
    }
}

/// What led to a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// No believable position.
    Encoder(EncoderFault),
    /// The amplifier's fault line.
    Amplifier,
    /// Set-points stopped coming.
    Communication,
    /// The axis was further from its reference than it may, for longer than it may.
    FollowingError,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Encoder(fault) => fault.fmt(f),
            Self::Amplifier => f.write_str("amplifier fault"),
            Self::Communication => f.write_str("no set-points"),
            Self::FollowingError => f.write_str("following error"),
        }
    }
}

/// What a module tells unasked. An answered command is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The amplifier is under current and the loop is closed.
    Enabled,
    /// The command is 0 and the amplifier disabled, since this step.
    Fault(Cause),
}

/// A module at its last step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Status {
    /// The state.
    pub state: State,
    /// Counts; 0 before the first good sample.
    pub position: i64,
    /// Counts a second, filtered.
    pub velocity: f32,
    /// Where the axis is to go, counts; the position while there is no current.
    pub set_point: i64,
    /// Where the axis is to be now, counts; the position while there is no current.
    pub reference: i64,
    /// The command, -1 to 1.
    pub command: f32,
}
