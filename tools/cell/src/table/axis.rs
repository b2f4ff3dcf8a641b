//! A module and its plant.

use puente_drives::pid::{BadConfig, Command, Config, Event, Module, Refused};
use puente_line::Instant;

use super::{AxisProfile, Feedback, Hardware, Plant};

/// One axis of the table under its module.
#[derive(Clone, Debug)]
pub struct Axis {
    module: Module,
    hardware: Hardware,
}

impl Axis {
    /// At rest, disabled; the module steps as [`Hardware::new`] says.
    pub fn new(profile: &AxisProfile, config: Config) -> Result<Self, BadConfig> {
        Ok(Self { module: Module::new(config)?, hardware: Hardware::new(profile, &config) })
    }

    /// Lets time pass, in steps of the plant and of the module. `event` is told what the module tells, and when.
    ///
    /// Time never goes back: a `now` earlier than the latest one changes nothing.
    pub fn advance(&mut self, now: Instant, mut event: impl FnMut(Instant, Event)) {
        self.hardware.advance(now, |input| {
            let output = self.module.step(input);
            if let Some(what) = output.event {
                event(input.now, what);
            }
            output
        });
    }

    /// Tells the module what the bus says, at the moment to which the axis has been advanced.
    pub fn command(&mut self, command: Command) -> Result<(), Refused> {
        self.module.command(self.hardware.now(), command)
    }

    /// The module.
    pub fn module(&self) -> &Module {
        &self.module
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        self.hardware.plant()
    }

    /// As [`Axis::plant`], to load it or to trip its amplifier.
    pub fn plant_mut(&mut self) -> &mut Plant {
        self.hardware.plant_mut()
    }

    /// Breaks the encoder, or mends it.
    pub fn set_feedback(&mut self, feedback: Feedback) {
        self.hardware.set_feedback(feedback);
    }

    /// Holds the encoder at what it says now.
    pub fn freeze_encoder(&mut self) {
        self.hardware.freeze_encoder();
    }
}
