//! What all boards with an STM32 have in common.

pub(super) mod executor;
mod log;
pub(super) mod reset;

pub use executor::run;
pub(super) use log::{last_words, log, logs, start as start_log};
