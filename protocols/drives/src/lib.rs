//! What servo drives mean by their registers and objects: names, units and limits, and which requests move a motor.
//!
//! One module a drive family. Nothing here sends or waits: the bytes come from and go to a protocol crate.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

pub mod cia402;
pub mod edb;
pub mod pid;
