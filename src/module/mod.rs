//! The application of a PID interface module: a position loop in an interrupt, and a bus task below it that says what the
//! loop is to do. It is all there is on its board; the gateway is another board's.

pub mod bus;
pub mod control;
pub mod lamp;
pub mod setup;
