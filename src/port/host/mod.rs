//! The host port: OS sockets, serial devices, raw TCP lines, and the simulated cell in process.

mod can;
pub mod defaults;
mod flash;
pub mod limits;
mod line;
mod log;
mod net;
mod restart;
mod scheduling;
mod sim;
mod tty;
mod vital;

/// A number that nobody can guess, another at each call.
pub fn random() -> u64 {
    use std::hash::{BuildHasher, Hasher, RandomState};
    // Its keys are the system's random numbers.
    RandomState::new().build_hasher().finish()
}

pub use can::{Can, CanSpec, check_can};
pub use flash::Flash;
pub use line::{BadPort, Line, LineSpec, check_line};
pub use log::start_log;
pub(super) use log::{log, logs};
pub use net::{Doors, Place, Ports};
pub use restart::restart;
pub use scheduling::exact_timers;
pub use sim::Simulation;
pub use vital::{history, may_move, stack, temperature};
