//! Modes of operation.

use core::fmt;

use super::object::{
    INTERPOLATION_SET_POINT, POSITION, TARGET_POSITION, TARGET_TORQUE, TARGET_VELOCITY, TORQUE, VELOCITY,
    VL_TARGET,
};
use super::{Controlword, Object};

/// Mode of operation (6060h, 6061h).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// None: 0.
    None,
    /// Profile position, PP: 1.
    ProfilePosition,
    /// Velocity, VL: 2.
    Velocity,
    /// Profile velocity, PV: 3.
    ProfileVelocity,
    /// Profile torque, PT: 4.
    ProfileTorque,
    /// Homing, HM: 6.
    Homing,
    /// Interpolated position, IP: 7.
    InterpolatedPosition,
    /// Cyclic synchronous position, CSP: 8.
    CyclicPosition,
    /// Cyclic synchronous velocity, CSV: 9.
    CyclicVelocity,
    /// Cyclic synchronous torque, CST: 10.
    CyclicTorque,
    /// The manufacturer's: -128 to -1.
    Vendor(i8),
}

impl Mode {
    /// Jog of the Lexium 23A (thesis, figure 26).
    pub const JOG: Self = Self::Vendor(-1);

    /// Its code. The manufacturer's are below 0; others are taken for none.
    pub const fn code(self) -> i8 {
        match self {
            Self::None => 0,
            Self::ProfilePosition => 1,
            Self::Velocity => 2,
            Self::ProfileVelocity => 3,
            Self::ProfileTorque => 4,
            Self::Homing => 6,
            Self::InterpolatedPosition => 7,
            Self::CyclicPosition => 8,
            Self::CyclicVelocity => 9,
            Self::CyclicTorque => 10,
            Self::Vendor(code) if code < 0 => code,
            Self::Vendor(_) => 0,
        }
    }

    /// The mode of a code; `None` for those that the standard reserves, 5 and above 10.
    pub const fn from_code(code: i8) -> Option<Self> {
        Some(match code {
            i8::MIN..=-1 => Self::Vendor(code),
            0 => Self::None,
            1 => Self::ProfilePosition,
            2 => Self::Velocity,
            3 => Self::ProfileVelocity,
            4 => Self::ProfileTorque,
            6 => Self::Homing,
            7 => Self::InterpolatedPosition,
            8 => Self::CyclicPosition,
            9 => Self::CyclicVelocity,
            10 => Self::CyclicTorque,
            _ => return None,
        })
    }

    /// Its set-point. Homing has none, and what the manufacturer's have is not known.
    pub const fn target(self) -> Option<Object> {
        Some(match self {
            Self::ProfilePosition | Self::CyclicPosition => TARGET_POSITION,
            Self::InterpolatedPosition => INTERPOLATION_SET_POINT,
            Self::ProfileVelocity | Self::CyclicVelocity => TARGET_VELOCITY,
            Self::Velocity => VL_TARGET,
            Self::ProfileTorque | Self::CyclicTorque => TARGET_TORQUE,
            Self::None | Self::Homing | Self::Vendor(_) => return None,
        })
    }

    /// What it controls, as it is.
    pub const fn actual(self) -> Option<Object> {
        Some(match self {
            Self::ProfilePosition | Self::CyclicPosition | Self::InterpolatedPosition | Self::Homing => {
                POSITION
            }
            Self::ProfileVelocity | Self::CyclicVelocity | Self::Velocity => VELOCITY,
            Self::ProfileTorque | Self::CyclicTorque => TORQUE,
            Self::None | Self::Vendor(_) => return None,
        })
    }

    /// The mode's bits of the controlword that let it follow its set-point, besides enable operation. Those of profile position
    /// and homing are edges, see [`super::position`] and [`super::homing`].
    pub const fn run_bits(self) -> u16 {
        match self {
            Self::InterpolatedPosition => Controlword::MODE_4,
            // Ramp enabled, unlocked, with its reference.
            Self::Velocity => Controlword::MODE_4 | Controlword::IMMEDIATELY | Controlword::RELATIVE,
            _ => 0,
        }
    }

    /// What bits 12 and 13 of the statusword say in it; `None` where they say nothing.
    pub const fn status_bits(self) -> (Option<&'static str>, Option<&'static str>) {
        match self {
            Self::ProfilePosition => (Some("set-point acknowledge"), Some("following error")),
            Self::ProfileVelocity => (Some("speed is 0"), Some("slippage too high")),
            Self::Homing => (Some("homing attained"), Some("homing error")),
            Self::InterpolatedPosition => (Some("interpolation active"), None),
            Self::CyclicPosition => (Some("follows the command value"), Some("following error")),
            Self::CyclicVelocity | Self::CyclicTorque => (Some("follows the command value"), None),
            Self::None | Self::Velocity | Self::ProfileTorque | Self::Vendor(_) => (None, None),
        }
    }

    /// Whether its set-points come with every SYNC.
    pub const fn is_cyclic(self) -> bool {
        matches!(
            self,
            Self::InterpolatedPosition | Self::CyclicPosition | Self::CyclicVelocity | Self::CyclicTorque
        )
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::None => "none",
            Self::ProfilePosition => "pp",
            Self::Velocity => "vl",
            Self::ProfileVelocity => "pv",
            Self::ProfileTorque => "pt",
            Self::Homing => "hm",
            Self::InterpolatedPosition => "ip",
            Self::CyclicPosition => "csp",
            Self::CyclicVelocity => "csv",
            Self::CyclicTorque => "cst",
            Self::Vendor(code) => return write!(f, "{code}"),
        })
    }
}

/// Supported drive modes (6502h).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Supported(pub u32);

impl Supported {
    /// Whether a mode is among them. Bit n stands for mode n + 1; the manufacturer's modes have bits of no standard.
    pub const fn has(self, mode: Mode) -> bool {
        match mode.code() {
            code @ 1..=10 => self.0 >> (code - 1) & 1 != 0,
            _ => false,
        }
    }
}
