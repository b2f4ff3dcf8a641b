//! CiA 402.

mod drive;
mod homing;
mod position;
mod profiles;
mod states;
