//! Exception codes.

use core::fmt;

use crate::function;

/// Why a server did not carry out a request (V1.1b3, clause 7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Exception {
    /// The function is not known here, or not allowed now.
    IllegalFunction = 1,
    /// An address of the request does not exist here.
    IllegalDataAddress = 2,
    /// The request's structure or quantity is wrong. Not meant for a value outside an application's range.
    IllegalDataValue = 3,
    /// The server failed while it carried out the request.
    ServerDeviceFailure = 4,
    /// Accepted; it will take long.
    Acknowledge = 5,
    /// Busy with a long command; ask again later.
    ServerDeviceBusy = 6,
    /// Parity error in extended memory.
    MemoryParityError = 8,
    /// The gateway has no path to the unit.
    GatewayPathUnavailable = 0x0A,
    /// The gateway got no usable reply from the unit.
    GatewayTargetFailed = 0x0B,
}

impl Exception {
    /// The exception's reply PDU to a request of `function`.
    pub const fn pdu(self, function: u8) -> [u8; 2] {
        [function | function::EXCEPTION, self as u8]
    }

    /// The exception of a code; `None` where the specification names none.
    pub const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            1 => Self::IllegalFunction,
            2 => Self::IllegalDataAddress,
            3 => Self::IllegalDataValue,
            4 => Self::ServerDeviceFailure,
            5 => Self::Acknowledge,
            6 => Self::ServerDeviceBusy,
            8 => Self::MemoryParityError,
            0x0A => Self::GatewayPathUnavailable,
            0x0B => Self::GatewayTargetFailed,
            _ => return None,
        })
    }
}

impl fmt::Display for Exception {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::IllegalFunction => "illegal function",
            Self::IllegalDataAddress => "illegal data address",
            Self::IllegalDataValue => "illegal data value",
            Self::ServerDeviceFailure => "server device failure",
            Self::Acknowledge => "acknowledge",
            Self::ServerDeviceBusy => "server device busy",
            Self::MemoryParityError => "memory parity error",
            Self::GatewayPathUnavailable => "gateway path unavailable",
            Self::GatewayTargetFailed => "gateway target device failed to respond",
        })
    }
}

impl core::error::Error for Exception {}
