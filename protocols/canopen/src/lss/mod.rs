//! Layer setting services: node-IDs and bit rates over the bus (CiA 305).
//!
//! - [`Request`], [`Response`]: the eight bytes of a message, for either end.
//! - [`Master`]: one service at a time, and fastscan, which finds a node that has no node-ID.

mod fastscan;
mod master;
mod message;

pub use fastscan::Known;
pub use master::{Action, Busy, Command, Failure, Master, Outcome};
pub use message::{Mode, Part, Request, Response};

/// Who a node is: the values of 1018h, by which no two nodes are alike.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Vendor-ID.
    pub vendor: u32,
    /// Product code.
    pub product: u32,
    /// Revision number.
    pub revision: u32,
    /// Serial number.
    pub serial: u32,
}

impl Identity {
    /// One of its values.
    pub const fn part(&self, part: Part) -> u32 {
        match part {
            Part::Vendor => self.vendor,
            Part::Product => self.product,
            Part::Revision => self.revision,
            Part::Serial => self.serial,
        }
    }

    /// Sets one of its values.
    pub const fn set(&mut self, part: Part, value: u32) {
        match part {
            Part::Vendor => self.vendor = value,
            Part::Product => self.product = value,
            Part::Revision => self.revision = value,
            Part::Serial => self.serial = value,
        }
    }
}
