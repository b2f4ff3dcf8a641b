//! The host port: OS sockets, serial devices, raw TCP lines, and the simulated cell in process.

pub mod limits;
mod line;
mod net;
mod restart;
mod scheduling;
mod sim;
mod tty;

pub use line::{BadPort, Line, LineSpec};
pub use net::{Doors, Place};
pub use restart::restart;
pub use scheduling::exact_timers;
