//! PID interface modules: a position loop for amplifiers without a bus of their own.
//!
//! Source: the Querétaro thesis (chapters 3.1.4, 3.2.5 and 4.1, appendix): one module an axis closes a PID position loop
//! from an encoder to the ±10 V input of an ADS 50/10 amplifier, and takes Kp, Ki, Kd and a set-point from the bus. It
//! gives neither the equations nor the units of the gains, and no enable, stop or supervision: these are this project's.
//!
//! What is here does no input or output. Firmware, or a simulation, samples the encoder and the amplifier's fault line at
//! the loop rate, calls [`Module::step`] and applies the [`Output`]; what the bus says goes to [`Module::command`]:
//!
//! ```
//! use puente_drives::pid::{Command, Config, Encoder, Gains, Input, Module, Width};
//! use puente_line::Instant;
//!
//! let mut module = Module::new(Config::new(Encoder::Binary(Width::W16))).unwrap();
//! let input = |counter, micros| Input {
//!     encoder: Ok(counter),
//!     amplifier_fault: false,
//!     now: Instant::from_micros(micros),
//! };
//! module.step(input(40, 100));
//! module.command(Instant::from_micros(150), Command::Gains(Gains::new(0.001, 0.0, 0.0).unwrap())).unwrap();
//! module.command(Instant::from_micros(150), Command::Enable).unwrap();
//! assert!(module.step(input(40, 200)).enable);
//! ```
//!
//! Units: positions are encoder counts (after x4 decoding, where the encoder is incremental), velocities counts a
//! second. A command is a part of full scale, -1 to 1, for -10 V to +10 V or for PWM with a direction line.
//!
//! # The loop
//! With the error e = reference - position, the filtered velocity v and the period T of the loop:
//!
//! ```text
//! v += (change of position / T - v) T / (filter + T)
//! i += Ki T e
//! u  = Kp e + i - Kd v
//! ```
//!
//! - An error within the deadband counts as 0, one outside it as it is.
//! - The derivative acts on the measurement: a step of the set-point does not kick.
//! - u is held within the output limit, and changes by no more than the slew rate allows.
//! - Anti-windup by clamping: while limit or slew hold u back, an error that would drive it further is not integrated; the
//!   integral never exceeds the output limit.
//!
//! All arithmetic is in f32 and in integers, without fused operations: the same inputs give the same outputs on every
//! machine. It has no division; reciprocals are taken at construction.

mod config;
mod control;
mod encoder;
mod gains;
pub mod gray;
mod module;
mod quadrature;
mod reference;
pub mod ssi;
mod state;
mod wide;

pub use config::{BadConfig, Config};
pub use encoder::{Encoder, EncoderFault};
pub use gains::{BadGain, Gains};
pub use module::{Input, Module, Output};
pub use quadrature::{Edge, Quadrature};
pub use state::{Cause, Command, Event, Refused, State, Status};
pub use wide::{Wide, Width};
