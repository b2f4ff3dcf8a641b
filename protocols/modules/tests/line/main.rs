//! Gateways and modules on a line that judges.

mod cycle;
mod faults;
mod rig;
mod rivals;
mod thesis;
