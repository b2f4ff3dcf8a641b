//! Modes of operation.

use core::fmt;

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
