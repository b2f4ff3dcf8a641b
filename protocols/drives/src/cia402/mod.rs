//! CiA 402: drives and motion control over CANopen.
//!
//! - [`State`], [`Command`]: the power drive state machine. [`Controlword`], [`Statusword`]: how it is told and tells.
//! - [`Machine`]: takes a drive to a state, step by step; a drive under current never jumps.
//! - [`Mode`]: modes of operation. [`position`]: the handshake of profile position. [`homing`]: homing.
//!   [`Period`]: the grid of interpolated position. [`way`]: the set-points to a position.
//! - [`object`]: the objects of it all. [`Profile`]: what is particular to a drive. [`check`]: whether a node is such a drive.
//!
//! Nothing here sends or waits: whoever does brings the statusword, and writes the objects it is told to.
//!
//! Sources: CiA 402 (IEC 61800-7-201), as told by ros_canopen and python-canopen; manuals of Festo (CMMP), Elmo and Delta; the
//! Mendoza thesis for the Lexium 23A. What only a sibling's manual says is marked *assumed*.

pub mod check;
mod command;
mod control;
pub mod homing;
mod machine;
mod mode;
pub mod object;
mod period;
pub mod position;
mod preset;
mod profile;
mod state;
mod status;
pub mod way;

pub use command::{Command, Transition, transition};
pub use control::Controlword;
pub use machine::{Advice, Goal, Machine, Progress};
pub use mode::{Mode, Supported};
pub use object::{Kind, Object};
pub use period::Period;
pub use preset::{Preset, presets};
pub use profile::{Interpolation, PdoSet, Profile, parameter_of_delta};
pub use state::State;
pub use status::Statusword;
