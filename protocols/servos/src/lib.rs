//! CiA 402 drives on a CANopen bus: the gateway's end.
//!
//! Sans-io, as what it is made of: [`puente_canopen::manager`] runs the bus and knows nothing of drives,
//! [`puente_drives::cia402`] knows drives and nothing of the bus.
//!
//! [`Master`] is a manager with drives. What is wanted of a drive ([`Order`]) stays wanted; it is told in receive PDOs when it
//! changes, and what no PDO has is written. What the drive is at ([`Report`]) comes in its transmit PDOs. The set-points of
//! cyclic modes follow every SYNC, and count from the next one. [`setup`] says which PDO does what.
//!
//! # What moves a drive, and what does not
//! - A drive is told to go under current only after its set-points have been set to where it stands, and the mode it is to be
//!   in has been shown. One that somebody else had put under current is halted first.
//! - Stops are sent before everything else, and wait for no SYNC.
//! - What is wanted of a drive is taken back ([`Action::Fell`]) when it is in fault, leaves operation by itself, is lost, boots,
//!   is not operational, or the bus is off. Nothing moves when it is back: current and motion do not count before something
//!   else has been wanted, Observe for one.
//! - A fault is reset by [`Order::Reset`] only.
//! - A mode is changed at standstill. What was halted does not go on when the halt is over.
//!
//! None of this is a safety function: what stops a drive whose gateway is gone is the drive's own supervision.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod drive;
mod master;
pub mod setup;
mod types;

pub use master::{Counters, Master};
pub use types::{Action, Axis, Failure, Homing, Motion, Node, Order, Progress, Report, Why};
