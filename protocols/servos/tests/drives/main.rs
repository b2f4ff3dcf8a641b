//! Drives on a bus, in virtual time.

mod anything;
mod boot;
mod device;
mod faults;
mod moves;
mod rig;
mod sync;
