//! SLCAN: a CAN adapter that is spoken to in lines of ASCII, as Lawicel's CAN232 and CANUSB brought it up.
//!
//! Sans-io: bytes, frames and the time go in, lines and frames come out.
//!
//! - [`Lines`]: bytes to lines, for both ends.
//! - [`Command`]: what a client says to an adapter. [`Reply`]: what the adapter says.
//! - [`Client`]: an adapter opened, fed and looked after, by the end that has no CAN itself.
//!
//! There is no standard. Sources: Lawicel's manuals of CAN232 and CANUSB as remembered, python-can's `slcan`, Linux' slcan
//! driver and the README of MAC-CAN's SLCAN, which agree where nothing else is said. What adapters do differently is noted at each item.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod client;
mod command;
mod digits;
mod lines;
mod rate;
mod reply;

pub use client::{Action, Busy, Client, Config, Counters, Event, Flow};
pub use command::{BadCommand, Command};
pub use lines::{End, Lines, MAX_LINE, Text};
pub use rate::Rate;
pub use reply::{BadReply, BusState, Flags, Reply};
