//! Gateways and modules on a line that judges.

mod cycle;
mod rig;
mod rivals;
mod thesis;
