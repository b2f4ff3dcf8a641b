//! CANopen nodes on a CAN bus in virtual time.

mod bus;
