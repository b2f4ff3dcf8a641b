//! What all boards have in common: TCP/IP, the places for clients, and the sizes that a microcontroller allows.

mod address;
mod doors;
pub mod limits;
mod mdns;
mod net;
mod restart;
mod socket;

pub use address::Address;
pub(super) use address::join;
pub use net::Network;
pub(super) use net::stack;
pub use restart::restart;
pub use socket::{Place, Socket};
pub(super) use socket::{Ports, places};
