//! CANopen nodes on a CAN bus in virtual time.

mod bench;
mod bus;
mod modes;
mod nodes;
mod states;
