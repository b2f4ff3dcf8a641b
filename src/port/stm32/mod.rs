//! What all boards with an STM32 have in common.

pub(super) mod executor;
pub(super) mod line;
mod log;
mod receiver;
pub(super) mod reset;
mod transmitter;

#[cfg(feature = "nucleo-f429zi")]
#[path = "driver_enable_pin.rs"]
mod driver_enable;
#[cfg(not(feature = "nucleo-f429zi"))]
#[path = "driver_enable_usart.rs"]
mod driver_enable;

#[cfg(feature = "nucleo-f429zi")]
#[path = "registers_v2.rs"]
mod registers;
#[cfg(not(feature = "nucleo-f429zi"))]
#[path = "registers_v3.rs"]
mod registers;

pub use executor::run;
pub use line::Line;
pub(super) use log::{last_words, log, logs, start as start_log};
