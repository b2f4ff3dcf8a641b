//! A simulated cell: EDB servo drives as Modbus slaves on one serial line, with dynamics and faults.
//!
//! The library is sans-io: the caller says what the master sent and what time it is, and asks which bytes are on the
//! line. Everything follows from these calls and from [`Config::seed`], so a test runs on a mock clock. The program
//! `cell` puts the same cell on a pseudo terminal, a TCP port or a serial device.
//!
//! ```
//! use puente_cell::{Cell, Config};
//! use puente_line::{Instant, Settings};
//! use puente_modbus::Mode;
//!
//! let line = Settings { baud: 9600, format: "8O1".parse().unwrap() };
//! let mut cell = Cell::new(Config::new(Mode::Ascii, line, &[1, 2, 3]));
//! cell.receive(Instant::ZERO, b":010309010001F1\r\n");
//! // Ready, waiting, mains present, motor stopped.
//! assert_eq!(cell.poll(Instant::from_millis(100)).unwrap(), b":01030201A455\r\n".as_slice());
//! ```
//!
//! [`can`] has CANopen nodes on a CAN bus. [`table`] is another cell: the coordinate table, whose axes have PID interface modules.
//!
//! Left out: ESTUN drives answer the first two communication faults in a row with an error frame and drop the third
//! silently; the cell drops every frame whose check does not match. The two directions do not collide: a reply that
//! comes late is seen whole, even while the master sends.
#![deny(unsafe_code)]
#![deny(missing_docs)]

mod answer;
pub mod can;
mod cell;
mod drive;
mod fault;
pub mod framed;
mod line;
pub mod live;
mod log;
mod motor;
mod profile;
pub mod table;

pub use cell::{Cell, Config};
pub use drive::{Drive, DriveConfig};
pub use fault::{BadFault, Fault};
pub use log::Event;
pub use profile::Profile;
