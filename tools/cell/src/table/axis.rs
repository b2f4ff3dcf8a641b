//! A module and its plant.

use std::time::Duration;

use puente_drives::pid::{
    BadConfig, Command, Config, Encoder, EncoderFault, Event, Input, Module, Output, Refused, gray,
};
use puente_line::Instant;

use super::{AxisProfile, Plant};

/// What the module sees of the encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Feedback {
    /// What it says.
    #[default]
    Sound,
    /// Always the same sample: a coupling came loose.
    Frozen(u32),
    /// No sample.
    Lost(EncoderFault),
}

/// One axis of the table under its module.
#[derive(Clone, Debug)]
pub struct Axis {
    module: Module,
    plant: Plant,
    encoder: Encoder,
    feedback: Feedback,
    output: Output,
    /// Between two steps of the module.
    period: Duration,
    /// Of the plant's last step.
    now: Instant,
    next: Instant,
}

impl Axis {
    /// At rest, disabled. The module's rate should divide 100 kHz: it steps with the plant, at the first step that is due.
    pub fn new(profile: &AxisProfile, config: Config) -> Result<Self, BadConfig> {
        let module = Module::new(config)?;
        let period = Duration::from_nanos(1_000_000_000 / u64::from(config.rate));
        Ok(Self {
            module,
            plant: Plant::new(profile),
            encoder: config.encoder,
            feedback: Feedback::Sound,
            output: Output { command: 0.0, enable: false, event: None },
            period,
            now: Instant::ZERO,
            next: Instant::ZERO,
        })
    }

    /// Lets time pass, in steps of the plant and of the module. `event` is told what the module tells, and when.
    ///
    /// Time never goes back: a `now` earlier than the latest one changes nothing.
    pub fn advance(&mut self, now: Instant, mut event: impl FnMut(Instant, Event)) {
        while self.now + Plant::STEP <= now {
            if self.now >= self.next {
                self.next += self.period;
                let input =
                    Input { encoder: self.sample(), amplifier_fault: self.plant.fault(), now: self.now };
                self.output = self.module.step(input);
                if let Some(what) = self.output.event {
                    event(self.now, what);
                }
            }
            self.plant.step(f64::from(self.output.command), self.output.enable);
            self.now += Plant::STEP;
        }
    }

    /// Tells the module what the bus says, at the moment to which the axis has been advanced.
    pub fn command(&mut self, command: Command) -> Result<(), Refused> {
        self.module.command(self.now, command)
    }

    fn sample(&self) -> Result<u32, EncoderFault> {
        match self.feedback {
            Feedback::Sound => Ok(self.raw()),
            Feedback::Frozen(sample) => Ok(sample),
            Feedback::Lost(fault) => Err(fault),
        }
    }

    /// The encoder's sample, as wide as it is.
    fn raw(&self) -> u32 {
        let number = self.plant.counts() as u32 & self.encoder.width().max();
        match self.encoder {
            Encoder::Binary(_) => number,
            Encoder::Gray(_) => gray::from_binary(number),
        }
    }

    /// The module.
    pub fn module(&self) -> &Module {
        &self.module
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// As [`Axis::plant`], to load it or to trip its amplifier.
    pub fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    /// Breaks the encoder, or mends it.
    pub fn set_feedback(&mut self, feedback: Feedback) {
        self.feedback = feedback;
    }

    /// Holds the encoder at what it says now.
    pub fn freeze_encoder(&mut self) {
        self.feedback = Feedback::Frozen(self.raw());
    }
}
