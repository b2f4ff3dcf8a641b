//! What is done about a node that has booted: is it the right one, its configuration, its supervision, its start
//! (7.3.1; CiA 302-2 has it in more detail).

use core::fmt;

use crate::dcf::List;
use crate::lss::{Known, Part};
use crate::sdo::{Abort, Failure};
use crate::{Address, nmt, object};

/// How a node is told to show that it is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signs {
    /// As it does.
    Unchanged,
    /// A heartbeat so often (1017h), ms; 0: none.
    Heartbeat(u16),
    /// Guarding, without a heartbeat.
    Guarding {
        /// Guard time (100Ch), ms.
        time: u16,
        /// Life time factor (100Dh).
        factor: u8,
    },
}

/// What a node is to be.
#[derive(Clone, Copy, Debug)]
pub struct Plan<'a> {
    /// Its device type (1000h), where it matters.
    pub device_type: Option<u32>,
    /// Those values of its identity (1018h) that matter.
    pub identity: Known,
    /// What is written to it.
    pub configuration: List<'a>,
    /// What is written to it after that where it takes it: a refusal counts for nothing, but is told.
    pub wishes: List<'a>,
    /// How it shows that it is there.
    pub signs: Signs,
    /// It is started in the end.
    pub starts: bool,
}

impl Plan<'_> {
    /// Nothing is asked of the node, and nothing told.
    pub const NOTHING: Self = Self {
        device_type: None,
        identity: Known { vendor: None, product: None, revision: None, serial: None },
        configuration: List::EMPTY,
        wishes: List::EMPTY,
        signs: Signs::Unchanged,
        starts: false,
    };
}

/// What is to be done next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step<'a> {
    /// Read this.
    Read(Address),
    /// Write this.
    Write {
        /// Where.
        address: Address,
        /// What.
        value: Value<'a>,
    },
    /// Command this to the node; nothing answers.
    Command(nmt::Command),
    /// All has been done.
    Done,
}

/// A value to be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Value<'a> {
    /// Of the configuration.
    Configured(&'a [u8]),
    /// 8 bits.
    U8(u8),
    /// 16 bits.
    U16(u16),
}

impl Value<'_> {
    /// Puts its bytes into `buffer`, the low one first, where they are few; those of a configuration are there already.
    pub fn bytes<'b>(&'b self, buffer: &'b mut [u8; 2]) -> &'b [u8] {
        match self {
            Self::Configured(bytes) => bytes,
            Self::U8(value) => {
                *buffer = [*value, 0];
                buffer.get(..1).unwrap_or_default()
            }
            Self::U16(value) => {
                *buffer = value.to_le_bytes();
                buffer
            }
        }
    }
}

/// Why a node is not booted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is another kind of device.
    DeviceType {
        /// What it is to be.
        expected: u32,
        /// What it is.
        received: u32,
    },
    /// It is another node.
    Identity {
        /// In this.
        part: Part,
        /// What it is to be.
        expected: u32,
        /// What it is.
        received: u32,
    },
    /// A value has not 32 bits.
    Size {
        /// Of this object.
        address: Address,
        /// Bytes that came.
        received: usize,
    },
    /// An object could not be read or written.
    Failed {
        /// Which.
        address: Address,
        /// Why.
        failure: Failure,
    },
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::DeviceType { expected, received } => {
                write!(f, "device type {received:08X}h instead of {expected:08X}h")
            }
            Self::Identity { part, expected, received } => {
                let name = match part {
                    Part::Vendor => "vendor",
                    Part::Product => "product code",
                    Part::Revision => "revision",
                    Part::Serial => "serial number",
                };
                write!(f, "{name} {received:08X}h instead of {expected:08X}h")
            }
            Self::Size { address, received } => write!(f, "{address} has {received} bytes instead of 4"),
            Self::Failed { address, failure } => write!(f, "{address}: {failure}"),
        }
    }
}

impl core::error::Error for Verdict {}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum At {
    DeviceType,
    Identity(Part),
    Entry(usize),
    Wish(usize),
    /// Of those that the signs take.
    Signs(u8),
    Start,
    Done,
}

/// A node that is being booted: [`Boot::step`] says what to do, [`Boot::done`] takes what came of it.
#[derive(Clone, Debug)]
pub struct Boot<'a> {
    plan: Plan<'a>,
    at: At,
    declined: Option<(Address, Abort)>,
}

impl<'a> Boot<'a> {
    /// Of a node that has said its boot-up, or has been told to reset its communication.
    pub fn new(plan: Plan<'a>) -> Self {
        let mut boot = Self { plan, at: At::DeviceType, declined: None };
        boot.skip();
        boot
    }

    /// What is to be done next.
    pub fn step(&self) -> Step<'a> {
        match self.at {
            At::DeviceType => Step::Read(object::DEVICE_TYPE),
            At::Identity(part) => Step::Read(Address::new(object::VENDOR.index, part as u8 + 1)),
            At::Entry(number) => write(self.plan.configuration, number),
            At::Wish(number) => write(self.plan.wishes, number),
            At::Signs(number) => match self.sign(number) {
                Some((address, value)) => Step::Write { address, value },
                None => Step::Done,
            },
            At::Start => Step::Command(nmt::Command::Start),
            At::Done => Step::Done,
        }
    }

    /// Takes what came of it: the bytes that were read, nothing where something was written or commanded, or why it failed.
    ///
    /// # Errors
    /// Any [`Verdict`]; the node is to be left alone then, and the step is still to be done.
    pub fn done(&mut self, result: Result<&[u8], Failure>) -> Result<(), Verdict> {
        match self.at {
            At::DeviceType => {
                let received = self.word(result)?;
                if let Some(expected) = self.plan.device_type.filter(|expected| *expected != received) {
                    return Err(Verdict::DeviceType { expected, received });
                }
            }
            At::Identity(part) => {
                let received = self.word(result)?;
                if let Some(expected) = self.plan.identity.part(part).filter(|expected| *expected != received)
                {
                    return Err(Verdict::Identity { part, expected, received });
                }
            }
            // Where a node has no heartbeat there is none to be switched off.
            At::Signs(0) if matches!(self.plan.signs, Signs::Guarding { .. }) => {
                if let Err(failure) = result
                    && !matches!(failure, Failure::Aborted(_))
                {
                    return Err(Verdict::Failed { address: self.address(), failure });
                }
            }
            At::Wish(_) if matches!(result, Err(Failure::Aborted(_))) => {
                self.declined = result.err().map(|failure| (self.address(), failure.code()));
            }
            At::Entry(_) | At::Wish(_) | At::Signs(_) => {
                result.map_err(|failure| Verdict::Failed { address: self.address(), failure })?;
            }
            At::Start | At::Done => {}
        }
        self.at = self.after();
        self.skip();
        Ok(())
    }

    /// The wish that the node has declined last, and why. Told once.
    pub const fn declined(&mut self) -> Option<(Address, Abort)> {
        self.declined.take()
    }

    fn address(&self) -> Address {
        match self.step() {
            Step::Read(address) | Step::Write { address, .. } => address,
            Step::Command(_) | Step::Done => Address::new(0, 0),
        }
    }

    fn word(&self, result: Result<&[u8], Failure>) -> Result<u32, Verdict> {
        let address = self.address();
        let bytes = result.map_err(|failure| Verdict::Failed { address, failure })?;
        let size = Verdict::Size { address, received: bytes.len() };
        bytes.try_into().map(u32::from_le_bytes).map_err(|_| size)
    }

    fn after(&self) -> At {
        match self.at {
            At::DeviceType => At::Identity(Part::Vendor),
            At::Identity(part) => Part::from_number(part as u8 + 1).map_or(At::Entry(0), At::Identity),
            At::Entry(number) => At::Entry(number + 1),
            At::Wish(number) => At::Wish(number + 1),
            At::Signs(number) => At::Signs(number + 1),
            At::Start | At::Done => At::Done,
        }
    }

    /// Passes over what the plan does not ask for.
    fn skip(&mut self) {
        loop {
            self.at = match self.at {
                At::DeviceType if self.plan.device_type.is_none() => self.after(),
                At::Identity(part) if self.plan.identity.part(part).is_none() => self.after(),
                At::Entry(number) if self.plan.configuration.get(number).is_none() => At::Wish(0),
                At::Wish(number) if self.plan.wishes.get(number).is_none() => At::Signs(0),
                At::Signs(number) if self.sign(number).is_none() => At::Start,
                At::Start if !self.plan.starts => At::Done,
                _ => return,
            };
        }
    }

    /// What is written for the node's signs. A node that guards has no heartbeat, so that goes first.
    fn sign(&self, number: u8) -> Option<(Address, Value<'static>)> {
        match (self.plan.signs, number) {
            (Signs::Heartbeat(time), 0) => Some((object::HEARTBEAT_TIME, Value::U16(time))),
            (Signs::Guarding { .. }, 0) => Some((object::HEARTBEAT_TIME, Value::U16(0))),
            (Signs::Guarding { time, .. }, 1) => Some((object::GUARD_TIME, Value::U16(time))),
            (Signs::Guarding { factor, .. }, 2) => Some((object::LIFE_TIME_FACTOR, Value::U8(factor))),
            _ => None,
        }
    }
}

/// The entry of this number is to be written.
fn write(list: List<'_>, number: usize) -> Step<'_> {
    match list.get(number) {
        Some(entry) => Step::Write { address: entry.address, value: Value::Configured(entry.data) },
        None => Step::Done,
    }
}
