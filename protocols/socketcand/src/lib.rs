//! socketcand: CAN frames over TCP, as texts between `<` and `>`.
//!
//! Sans-io: bytes go in, messages and frames come out.
//!
//! - [`Texts`]: bytes to texts, for both ends.
//! - [`Request`]: what a client says. [`Message`]: what the server says.
//!
//! Source: the README and the code of socketcand; python-can's `socketcand` where it is stricter. Known here are the modes
//! RAW and BCM as far as they send frames once; [`Request`] lists what is only named, and answered by an error.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod message;
mod request;
mod texts;
mod words;

pub use message::{BadMessage, Message};
pub use request::{BadRequest, Request};
pub use texts::{MAX_TEXT, Text, Texts};

/// TCP port of a socketcand.
pub const PORT: u16 = 29_536;
/// Longest name of a bus.
pub const MAX_BUS: usize = 16;
