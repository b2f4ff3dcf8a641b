//! A CAN bus with CANopen nodes in virtual time.
//!
//! Sans-io as [`crate::Cell`] is: frames and the time go in, frames come out, and everything follows from these calls and from
//! [`Config::seed`]. Its ports are the seats of stations outside, such as gateways; none hears its own frames.
//!
//! ```
//! use puente_canopen::{Frame, Id};
//! use puente_cell::can::{Cell, Config};
//! use puente_line::Instant;
//!
//! let mut cell = Cell::new(Config { ports: 2, ..Config::new(1_000_000) });
//! let frame = Frame::new(Id::base(0x123), b"hello").unwrap();
//! cell.send(Instant::from_micros(100), 0, &frame);
//! let heard = Instant::from_micros(100 + u64::from(frame.bits()) - 3);
//! assert_eq!(cell.poll(heard.before(), 1), None);
//! assert_eq!(cell.poll(heard, 1), Some(frame));
//! assert_eq!(cell.poll(heard, 0), None);
//! ```

pub mod bus;
mod cell;
mod drive;
mod fault;
mod node;

pub use cell::{Cell, Config, DriveConfig};
pub use drive::{AxisConfig, Cycles, Drive};
pub use fault::{BadFault, DriveFault, Fault, WORDS};
pub use node::{BadModel, Model, Node};
