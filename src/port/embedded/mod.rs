//! What all boards have in common: TCP/IP, the places for clients, and the sizes that a microcontroller allows.

pub mod defaults;
mod doors;
pub mod limits;
mod net;
mod restart;
mod socket;

pub(super) use net::stack;
pub use net::{Address, Network};
pub use restart::restart;
pub use socket::{Place, Socket};
