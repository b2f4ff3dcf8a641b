//! The TX8 coordinate table of the Querétaro thesis (chapter 4.1): three axes with DC motors, encoders and ADS 50/10
//! amplifiers, each under the PID module that real firmware runs ([`puente_drives::pid`]).
//!
//! Everything is in fixed steps of [`Plant::STEP`] and follows from the calls alone: the same calls give the same motion
//! on every run.

mod axis;
mod hardware;
mod plant;
mod profile;

pub use axis::Axis;
pub use hardware::{Feedback, Hardware};
pub use plant::Plant;
pub use profile::{Amplifier, AxisProfile, Motor};

use puente_drives::pid::{BadConfig, Config, Event};
use puente_line::Instant;

/// The table: X, Y and Z.
#[derive(Clone, Debug)]
pub struct Table {
    axes: [Axis; 3],
}

impl Table {
    /// A table whose axes are alike, at rest at position 0 of their travel.
    pub fn new(profile: &AxisProfile, config: Config) -> Result<Self, BadConfig> {
        let axis = Axis::new(profile, config)?;
        Ok(Self { axes: [axis.clone(), axis.clone(), axis] })
    }

    /// The axes X, Y and Z.
    pub fn axes(&self) -> &[Axis; 3] {
        &self.axes
    }

    /// As [`Table::axes`], to command them and to break them.
    pub fn axes_mut(&mut self) -> &mut [Axis; 3] {
        &mut self.axes
    }

    /// Lets time pass. `event` is told what the modules tell: which axis, and when.
    pub fn advance(&mut self, now: Instant, mut event: impl FnMut(usize, Instant, Event)) {
        for (number, axis) in self.axes.iter_mut().enumerate() {
            axis.advance(now, |at, what| event(number, at, what));
        }
    }
}
