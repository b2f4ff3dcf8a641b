//! CANopen from other networks, in ASCII (CiA 309-3): what clients command, and what they are answered.
//!
//! Sans-io: a line goes in, a [`Request`] comes out; a [`Reply`] is written. The bytes of an object become text, and text
//! bytes, piece by piece: of any length.
//!
//! - [`Session`]: what a client has set, and its lines. [`command`]: what it commands.
//! - [`value`]: the data types, to and from text.
//! - [`reply`], [`Error`]: what it is answered. [`indication`]: what it is told unasked. [`help`].
//!
//! The document is CiA's own and not public. The syntax, the numbers and the form of replies are those of CANopenNode's
//! gateway (309/CO_gateway_ascii, "DS v3.0.0"); the form of what is told unasked is that of lely's (src/co/gw_txt.c) where it
//! has one. What neither has says so.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod command;
mod error;
pub mod help;
pub mod indication;
pub mod leds;
mod number;
pub mod reply;
mod session;
mod tokens;
pub mod value;

pub use command::{Command, Request};
pub use error::Error;
pub use indication::Indication;
pub use reply::Reply;
pub use session::{Refused, Session};
