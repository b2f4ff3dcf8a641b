//! What all boards have in common: what survives a failure, the sizes that a microcontroller allows, and, where there is a
//! network, TCP/IP and the places for clients.

pub mod defaults;
mod fault;
#[cfg(feature = "test-hooks")]
pub(super) mod hooks;
pub mod limits;
#[cfg(network)]
mod network;
mod restart;
pub(super) mod stack;
#[cfg(feature = "axis-module")]
pub(super) mod tick;
pub(super) mod vital;

#[cfg(network)]
pub use network::{Address, Network, Place, Socket};
#[cfg(network)]
pub(super) use network::{Patient, network};
pub use restart::restart;
pub use stack::stack;
pub(super) use stack::started;
pub use vital::{alive, history, hung, may_move};
