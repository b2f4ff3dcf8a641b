//! What every serial protocol shares: time, baud rate, character format and the times that follow from them.
//!
//! Time is an argument everywhere in `protocols/`: an [`Instant`] in microseconds since start-up, from whatever clock
//! the caller has.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod format;
mod time;

pub use core::time::Duration;
pub use format::{BadFormat, Format, Parity, Settings};
pub use time::{Instant, micros, millis};
