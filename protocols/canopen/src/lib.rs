//! CANopen: the codecs of its communication objects, and what a manager does with them.
//!
//! Sans-io: frames and the time go in, frames and results come out.
//!
//! - [`frame`]: CAN frames. [`cob`]: node-IDs and COB-IDs. [`object`]: addresses in an object dictionary.
//! - [`nmt`]: commands and states of nodes. [`monitor`]: whether a node is there, by heartbeat or guarding.
//! - [`sdo`]: objects read and written, of any length. [`pdo`]: how PDOs are set up, and the values in them.
//! - [`heartbeat`], [`sync`], [`time`]: what a manager produces itself. [`emcy`]: what nodes report.
//! - [`boot`]: a node that has booted is judged, configured and started. [`dcf`]: with what.
//! - [`lss`]: node-IDs and bit rates given over the bus.
//! - [`manager`]: all of it together.
//!
//! Sources: CiA 301 version 4.2.0, whose clauses are meant where only a number stands, and CiA 305 for layer setting
//! services; the words are theirs.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod boot;
pub mod cob;
mod cycle;
pub mod dcf;
pub mod emcy;
pub mod frame;
pub mod heartbeat;
pub mod lss;
pub mod manager;
pub mod monitor;
pub mod nmt;
pub mod object;
pub mod pdo;
pub mod sdo;
pub mod sync;
pub mod time;

pub use cob::NodeId;
pub use frame::{Frame, Id};
pub use manager::Manager;
pub use monitor::Monitor;
pub use object::Address;
