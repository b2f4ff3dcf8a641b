//! A simulated RS-485 pair that several stations share, in virtual time, and that judges their manners.
//!
//! A [`Line`] has characters that take their time, propagation between any two stations, transceivers that need a while to
//! turn around, noise, and characters that overlap and become garbage. It watches every station with its own eyes and stops
//! with a [`Violation`] when one talks into another, leaves no gap, or goes on after a collision.
//!
//! [`Node`] is what a station on the line is; [`station`] makes one of a [`puente_framed::Station`], [`faulty`] has those that
//! behave badly, [`external`] one whose bytes come from outside: so a line in real time is made, with [`Line::run_until`] the
//! present.
//!
//! What it leaves out: voltage levels (a near station never drowns a far one), the capture of one signal by a receiver,
//! spikes on a line that nobody drives, and clocks that differ.

pub mod external;
pub mod faulty;
mod heard;
mod judge;
mod line;
mod medium;
mod noise;
mod seat;
pub mod station;
pub mod talker;

pub use heard::{Drive, Heard, Node};
pub use judge::{Rule, Violation};
pub use line::{Line, Totals};
pub use seat::{Place, Sense};
