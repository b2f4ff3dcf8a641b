//! What all boards have in common: TCP/IP, the places for clients, what survives a failure, and the sizes that a
//! microcontroller allows.

mod address;
mod doors;
#[cfg(feature = "test-hooks")]
mod echo;
mod fault;
#[cfg(feature = "test-hooks")]
pub(super) mod hooks;
pub mod limits;
mod mdns;
mod net;
mod restart;
mod socket;
mod stack;
pub(super) mod vital;

pub use address::Address;
pub use net::Network;
pub(super) use net::network;
pub use restart::restart;
pub use socket::{Place, Socket};
pub use stack::stack;
pub(super) use stack::started;
pub use vital::{history, hung, may_move};
