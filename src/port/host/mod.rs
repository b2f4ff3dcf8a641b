//! The host port: OS sockets, serial devices, raw TCP lines, and the simulated cell in process.

pub mod defaults;
mod flash;
pub mod limits;
mod line;
mod net;
mod restart;
mod scheduling;
mod sim;
mod tty;

pub use flash::Flash;
pub use line::{BadPort, Line, LineSpec, check_line};
pub use net::{Doors, Place};
pub use restart::restart;
pub use scheduling::exact_timers;
