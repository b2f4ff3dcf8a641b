//! What all boards have in common: TCP/IP, the places for clients, what survives a failure, and the sizes that a
//! microcontroller allows.

mod doors;
mod fault;
#[cfg(feature = "test-hooks")]
pub(super) mod hooks;
pub mod limits;
mod net;
mod restart;
mod socket;
mod stack;
pub(super) mod vital;

pub use net::Address;
pub(super) use net::network;
pub use restart::restart;
pub use socket::{Place, Socket};
pub(super) use socket::{Ports, places};
pub use stack::stack;
pub(super) use stack::started;
pub use vital::{history, hung, may_move};
