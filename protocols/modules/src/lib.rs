//! PID interface modules on the framed bus: what a gateway and a module say to each other, and both ends of it.
//!
//! Sans-io, as what it is made of: [`puente_framed`] knows the line and nothing of axes, [`puente_drives::pid`] the loop
//! and nothing of the bus.
//!
//! # What is said
//! | frame | from | each section |
//! |---|---|---|
//! | single, data | gateway | for one module: a [`Setting`] with its [`Order`] |
//! | single, status | module | for whoever asked: a [`Report`] |
//! | of a window, event | module | for the commander: an [event](mod@event) |
//! | of the thesis | anyone | for one module: a [`Setting`] without an order; answered by a receipt, or by a refusal |
//!
//! A gateway sends one frame a cycle, with a section for each of its axes. It says again and again what shall be
//! ([`Control`]), not what to change: a frame that is lost is made good by the next.
//!
//! # Answers
//! Those that a frame asks do not meet on the line: they answer in the order of the sections that ask. The first does so at
//! once. The k-th after it takes the line no sooner than k gaps and k answers later, less half an answer, which is when
//! the one before it is talking: then it follows that one after a gap, and takes its turn where that one is dead. Every
//! section of a frame of the thesis asks.
//!
//! # Who commands
//! - [`Control::Off`] and [`Control::Hold`] are obeyed whoever says them: anyone may stop an axis.
//! - Whoever's Hold puts a module under current is its *commander*, until it is without current again. Gains, set-points and
//!   [`Control::Follow`] count from the commander alone, and these and the commander's Hold alone keep the communication
//!   supervision of the module content.
//! - A Hold puts a module under current only if whoever says it has said Off or Observe since his last Hold or Follow. So one
//!   that is merely repeated undoes no one's Off, nor does it start a module that has just been powered up.
//! - After another's Hold, the commander has to say Hold before Follow counts again.
//! - In a fault only Off counts, which acknowledges it.
//!
//! None of this is a safety function, nor is it safe against a station that lies about its address. What stops an axis
//! whose commander is gone is the module's own supervision.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod decimal;
pub mod event;
pub mod master;
pub mod node;
mod order;
pub mod report;
pub mod setting;
mod turns;

pub use decimal::Decimal;
pub use master::Master;
pub use node::Node;
pub use order::{Control, Order};
pub use report::{Refusal, Report};
pub use setting::{Form, MAX_SET_POINT, Setting};
