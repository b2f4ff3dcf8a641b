//! Whether a node is a drive that can do what it is to do.

use core::fmt;

use puente_canopen::{Address, object as communication};

use super::object::{self, Kind, Object};
use super::{Mode, Profile, Supported};

/// What a node's answer must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Must {
    /// Its device profile is 402.
    BeADrive,
    /// It is there.
    Exist,
    /// It is there, or the mode that needs it is not the profile's.
    ExistFor(Mode),
    /// It names all modes of the profile; a drive may be without it.
    HaveModes,
}

/// An object that is read when a drive appears, and judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Check {
    /// What is read.
    pub object: Object,
    must: Must,
}

/// What is wrong with a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Complaint {
    /// It is no drive.
    NoDrive {
        /// Its device profile number.
        profile: u16,
    },
    /// It lacks an object.
    Missing {
        /// Which.
        address: Address,
    },
    /// An object has another length than it must have.
    Size {
        /// Which.
        address: Address,
        /// Bytes.
        expected: usize,
        /// Bytes.
        received: usize,
    },
    /// It lacks a mode that its profile has.
    Mode {
        /// Which.
        mode: Mode,
    },
}

impl fmt::Display for Complaint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoDrive { profile } => write!(f, "no drive: its device profile is {profile}, not 402"),
            Self::Missing { address } => write!(f, "object {address} is missing"),
            Self::Size { address, expected, received } => {
                write!(f, "object {address} has {received} bytes instead of {expected}")
            }
            Self::Mode { mode } => write!(f, "it does not have the mode {mode}"),
        }
    }
}

impl core::error::Error for Complaint {}

const fn check(object: Object, must: Must) -> Check {
    Check { object, must }
}

const CHECKS: &[Check] = &[
    check(Object { address: communication::DEVICE_TYPE, kind: Kind::U32 }, Must::BeADrive),
    check(object::STATUSWORD, Must::Exist),
    check(object::CONTROLWORD, Must::Exist),
    check(object::MODE, Must::Exist),
    check(object::MODE_DISPLAY, Must::Exist),
    check(object::SUPPORTED_MODES, Must::HaveModes),
    check(object::POSITION, Must::ExistFor(Mode::ProfilePosition)),
    check(object::TARGET_POSITION, Must::ExistFor(Mode::ProfilePosition)),
    check(object::TARGET_VELOCITY, Must::ExistFor(Mode::ProfileVelocity)),
    check(object::TARGET_TORQUE, Must::ExistFor(Mode::ProfileTorque)),
    check(object::HOMING_METHOD, Must::ExistFor(Mode::Homing)),
    check(object::INTERPOLATION_SET_POINT, Must::ExistFor(Mode::InterpolatedPosition)),
];

/// What is read of a drive of a profile, in this order.
pub fn of(profile: &Profile) -> impl Iterator<Item = Check> {
    // What modes a generic drive has it says itself.
    let generic = *profile == Profile::GENERIC;
    let modes = profile.modes;
    CHECKS.iter().copied().filter(move |check| match check.must {
        Must::BeADrive | Must::Exist => true,
        Must::ExistFor(mode) => !generic && modes.contains(&mode),
        Must::HaveModes => !generic,
    })
}

impl Check {
    /// Judges what the node answered: the object's bytes, or `None` where it does not have it.
    ///
    /// # Errors
    /// Any [`Complaint`].
    pub fn judge(&self, profile: &Profile, answer: Option<&[u8]>) -> Result<(), Complaint> {
        let address = self.object.address;
        let bytes = match (answer, self.must) {
            (Some(bytes), _) => bytes,
            (None, Must::HaveModes) => return Ok(()),
            (None, _) => return Err(Complaint::Missing { address }),
        };
        let expected = self.object.kind.size();
        let size = Complaint::Size { address, expected, received: bytes.len() };
        let value = self.object.kind.read(bytes).ok_or(size)?;
        match self.must {
            Must::BeADrive if value & 0xFFFF != 402 => {
                Err(Complaint::NoDrive { profile: (value & 0xFFFF) as u16 })
            }
            Must::HaveModes => {
                let supported = Supported(value as u32);
                let missing = profile.modes.iter().find(|mode| mode.code() > 0 && !supported.has(**mode));
                missing.map_or(Ok(()), |mode| Err(Complaint::Mode { mode: *mode }))
            }
            _ => Ok(()),
        }
    }
}
