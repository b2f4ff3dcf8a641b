//! Why a command of an axis was refused or failed.

use core::fmt;

use puente_canopen::emcy;
use puente_drives::cia402::State;
use puente_drives::{edb, pid};
use puente_modbus::Exception;
use puente_modules::Refusal;
use puente_servos::Node;

use crate::desk::{Failure, Leased};

/// Why a command of an axis was refused or failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisError {
    /// No axis has this name.
    UnknownAxis,
    /// Another client commands the axis.
    Leased(Leased),
    /// The servo is not enabled.
    NotEnabled,
    /// The drive shows an alarm, by its number.
    Alarm(u16),
    /// The module is in a fault.
    Fault(pid::Cause),
    /// The module has not done what it was told.
    Refused(Refusal),
    /// The node of the drive is not there, or refused.
    Node(puente_servos::Node),
    /// The drive is in a fault: its last error (603Fh), or else its emergency, where one is known.
    DriveFault(Option<u16>),
    /// The drive does not do what it was told, and its state.
    Drive(puente_servos::Failure, Option<State>),
    /// Another group is on its way.
    Group,
    /// There are no gains to hold the axis with.
    NoGains,
    /// The module takes text, and the digits of a gain do not fit.
    GainDigits,
    /// The drive has no such command; what it has, in words.
    Unsupported(&'static str),
    /// A value out of range.
    Range {
        /// What was asked for.
        value: i32,
        /// Lowest value allowed.
        min: i32,
        /// Highest value allowed.
        max: i32,
    },
    /// The bus gave no reply.
    Failure(Failure),
    /// The drive refused with a Modbus exception, by its code.
    Exception(u8),
}

impl AxisError {
    /// The word that programs go by.
    pub const fn code(&self) -> &'static str {
        match self {
            AxisError::UnknownAxis => "unknown-axis",
            AxisError::Leased(Leased::By(..)) => "leased",
            AxisError::Leased(Leased::Standstill(_)) => "standstill",
            AxisError::Leased(Leased::Stopping) => "stopping",
            AxisError::NotEnabled => "not-enabled",
            AxisError::Alarm(_) => "alarm",
            AxisError::Fault(_) => "fault",
            AxisError::Refused(_) => "refused",
            AxisError::Node(Node::Absent) => "absent",
            AxisError::Node(Node::Booting | Node::Present) => "booting",
            AxisError::Node(Node::Lost) => "lost",
            AxisError::Node(Node::Duplicate) => "duplicate",
            AxisError::Node(_) => "node-refused",
            AxisError::DriveFault(_) => "fault",
            AxisError::Group => "busy",
            AxisError::Drive(puente_servos::Failure::Following, _) => "following-error",
            AxisError::Drive(puente_servos::Failure::Homing, _) => "homing-error",
            AxisError::Drive(puente_servos::Failure::NoMode(_), _) => "no-mode",
            AxisError::Drive(..) => "drive",
            AxisError::NoGains => "no-gains",
            AxisError::GainDigits => "gains",
            AxisError::Unsupported(_) => "unsupported",
            AxisError::Range { .. } => "range",
            AxisError::Failure(Failure::NotSent(_)) => "not-sent",
            AxisError::Failure(Failure::NoReply(_)) => "no-reply",
            AxisError::Exception(_) => "exception",
        }
    }
}

impl fmt::Display for AxisError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AxisError::UnknownAxis => f.write_str("no axis has this name; 'axis' lists them"),
            AxisError::Leased(Leased::By(holder, left)) => {
                write!(
                    f,
                    "{holder} commands this axis, for {} ms unless it goes on; stop is allowed",
                    puente_line::millis(*left)
                )
            }
            AxisError::Leased(Leased::Standstill(left)) => {
                write!(
                    f,
                    "somebody else stopped this axis; give no motion command for {} ms",
                    puente_line::millis(*left)
                )
            }
            AxisError::Leased(Leased::Stopping) => {
                f.write_str("the gateway is stopping this axis; try again")
            }
            AxisError::NotEnabled => f.write_str("the servo is off; enable the axis first"),
            AxisError::Alarm(number) => {
                write!(
                    f,
                    "alarm {number}: {}; clear it first",
                    edb::alarm_name(*number).unwrap_or("undefined")
                )
            }
            AxisError::Fault(cause) => write!(f, "fault: {cause}; clear it first"),
            AxisError::Refused(refusal) => write!(f, "the module refused: {refusal}"),
            AxisError::Node(node) => write!(f, "its node is {node}"),
            AxisError::Group => f.write_str("a group is on its way; 'group status' tells how far"),
            AxisError::DriveFault(None) => f.write_str("fault; clear it first"),
            AxisError::DriveFault(Some(code)) => {
                write!(f, "fault {code:04X}h, {}; clear it first", emcy::describe(*code))
            }
            AxisError::Drive(failure, Some(state)) => write!(f, "{failure}; the drive is in {state}"),
            AxisError::Drive(failure, None) => failure.fmt(f),
            AxisError::NoGains => {
                f.write_str("a Kp of 0 holds no axis; give it gains first: axis NAME gains KP KI KD")
            }
            AxisError::GainDigits => f.write_str(
                "9 characters do not hold a gain to three digits, and the module takes text; payload = \"binary\" does",
            ),
            AxisError::Unsupported(instead) => f.write_str(instead),
            AxisError::Range { value, min, max } => write!(f, "{value} is out of range {min} to {max}"),
            AxisError::Failure(failure) => failure.fmt(f),
            AxisError::Exception(code) => match Exception::from_code(*code) {
                Some(exception) => write!(f, "the drive answered exception {code:02X}: {exception}"),
                None => write!(f, "the drive answered exception {code:02X}"),
            },
        }
    }
}

impl From<Leased> for AxisError {
    fn from(leased: Leased) -> Self {
        AxisError::Leased(leased)
    }
}

impl From<Failure> for AxisError {
    fn from(failure: Failure) -> Self {
        AxisError::Failure(failure)
    }
}
