//! Against the simulated drives of the cell: every mode, and what goes wrong on their bus.

mod faults;
mod modes;
mod rig;
