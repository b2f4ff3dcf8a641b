//! The gateway's end: what it wants of the axes of a bus, and what they are at.

mod types;

pub use types::{Action, Axis, Config, Output, Statistics};
