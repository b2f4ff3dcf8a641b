//! What goes wrong with a node, and how it is written.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use puente_canopen::{Frame, Id, NodeId};

/// The words of [`Fault`]'s text form.
pub const WORDS: &str = "\
mute, unmute          nobody hears the node; it hears the others, and acknowledges
die                   it is not on the bus any more, until a reset
bus-off               its error counter is too high; it comes back by itself
babble:ID:MS          it sends this identifier without a pause, for so many milliseconds
sdo-dead, sdo-alive   its SDO server hears nothing, or does again
sdo-dies:COUNT        its SDO server says so many messages more, and then hears nothing
slow:MS               its SDO server hears everything so much later
wrong-toggle          the toggle bit of its answers to guarding stands still
identity:PRODUCT      another product code
id:NUMBER             its switches are set to this node-ID, and it is switched off and on
emcy:COUNT            so many emergency messages at once
reset                 it is switched off and on
over-current, over-voltage, under-voltage, encoder
                      the drive falls with this error; it can be reset
hot, cool             the motor is too hot, which cannot be reset; or no more
blocked, free         something holds the axis; or no more
short, whole          of node 0, which is the bus: a short circuit, so that whoever sends goes off; or no more
";

/// Something that goes wrong with a node, or is mended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Nobody hears it.
    Mute(bool),
    /// It is not on the bus, until a [`Fault::Reset`].
    Die,
    /// Its transmit error counter is too high.
    BusOff,
    /// It sends a frame without data as often as it can, so long.
    Babble(Frame, Duration),
    /// Its SDO server hears nothing.
    SdoDead(bool),
    /// Its SDO server hears so many messages more, and then nothing.
    SdoDies(u32),
    /// Its SDO server hears everything so much later.
    Slow(Duration),
    /// The toggle bit of its answers to guarding stands still.
    WrongToggle,
    /// It has another product code from now on.
    Identity(u32),
    /// Somebody sets its switches to this node-ID, which another may have, and switches it off and on.
    Id(NodeId),
    /// It sends so many emergency messages at once.
    Emergencies(u8),
    /// It is switched off and on.
    Reset,
    /// Of the drive.
    Drive(DriveFault),
    /// Of the bus, which is node 0: a short circuit. No frame comes through, and whoever sends goes off.
    Short(bool),
}

/// Something that goes wrong with a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveFault {
    /// Short circuit at the output, or over-current.
    OverCurrent,
    /// DC link.
    OverVoltage,
    /// DC link.
    UnderVoltage,
    /// The motor is too hot: no reset works until it has cooled down.
    Hot(bool),
    /// The encoder is lost.
    Encoder,
    /// Something holds the axis.
    Blocked(bool),
}

/// A text that is no [`Fault`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadFault(String);

impl fmt::Display for BadFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "'{}' is no fault of a CANopen node", self.0)
    }
}

impl std::error::Error for BadFault {}

impl FromStr for Fault {
    type Err = BadFault;

    /// Reads the forms of [`WORDS`].
    fn from_str(text: &str) -> Result<Self, BadFault> {
        let bad = || BadFault(text.to_owned());
        let number = |text: &str| {
            let digits = text.strip_prefix("0x").map(|digits| u32::from_str_radix(digits, 16));
            digits.unwrap_or_else(|| text.parse()).map_err(|_| bad())
        };
        let millis = |text: &str| number(text).map(|ms| Duration::from_millis(ms.into()));
        let (word, rest) = text.split_once(':').unwrap_or((text, ""));
        Ok(match (word, rest) {
            ("slow", ms) => Self::Slow(millis(ms)?),
            ("sdo-dies", count) => Self::SdoDies(number(count)?),
            ("id", id) => {
                let id = number(id)?.try_into().ok().and_then(NodeId::new);
                Self::Id(id.ok_or_else(bad)?)
            }
            ("identity", product) => Self::Identity(number(product)?),
            ("emcy", count) => Self::Emergencies(number(count)?.try_into().map_err(|_| bad())?),
            ("babble", rest) => {
                let (id, ms) = rest.split_once(':').ok_or_else(bad)?;
                let id = u16::try_from(number(id)?).map_err(|_| bad())?;
                Self::Babble(Frame::new(Id::base(id), &[]).ok_or_else(bad)?, millis(ms)?)
            }
            (_, rest) if !rest.is_empty() => return Err(bad()),
            ("mute", _) => Self::Mute(true),
            ("unmute", _) => Self::Mute(false),
            ("die", _) => Self::Die,
            ("bus-off", _) => Self::BusOff,
            ("sdo-dead", _) => Self::SdoDead(true),
            ("sdo-alive", _) => Self::SdoDead(false),
            ("wrong-toggle", _) => Self::WrongToggle,
            ("reset", _) => Self::Reset,
            ("short", _) => Self::Short(true),
            ("whole", _) => Self::Short(false),
            ("over-current", _) => Self::Drive(DriveFault::OverCurrent),
            ("over-voltage", _) => Self::Drive(DriveFault::OverVoltage),
            ("under-voltage", _) => Self::Drive(DriveFault::UnderVoltage),
            ("hot", _) => Self::Drive(DriveFault::Hot(true)),
            ("cool", _) => Self::Drive(DriveFault::Hot(false)),
            ("encoder", _) => Self::Drive(DriveFault::Encoder),
            ("blocked", _) => Self::Drive(DriveFault::Blocked(true)),
            ("free", _) => Self::Drive(DriveFault::Blocked(false)),
            _ => return Err(bad()),
        })
    }
}
