//! A plant as the electronics of a module see and drive it.

use std::time::Duration;

use puente_drives::pid::{Config, Encoder, EncoderFault, Input, Output, gray};
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

/// A plant with its encoder, and the clock that a module steps by.
#[derive(Clone, Debug)]
pub struct Hardware {
    plant: Plant,
    encoder: Encoder,
    feedback: Feedback,
    /// Where an encoder that counts was switched on, counts.
    zero: i64,
    command: f32,
    enable: bool,
    /// Between two steps of the module.
    period: Duration,
    /// Of the plant's last step.
    now: Instant,
    next: Instant,
}

impl Hardware {
    /// At rest, disabled. The module's rate should divide 100 kHz: it steps with the plant, at the first step that is due.
    pub fn new(profile: &AxisProfile, config: &Config) -> Self {
        Self {
            plant: Plant::new(profile),
            encoder: config.encoder,
            feedback: Feedback::Sound,
            zero: 0,
            command: 0.0,
            enable: false,
            period: Duration::from_nanos(1_000_000_000 / u64::from(config.rate)),
            now: Instant::ZERO,
            next: Instant::ZERO,
        }
    }

    /// Lets time pass, in steps of the plant and of the module, which `module` is.
    ///
    /// Time never goes back: a `now` earlier than the latest one changes nothing.
    pub fn advance(&mut self, now: Instant, mut module: impl FnMut(Input) -> Output) {
        while self.now + Plant::STEP <= now {
            if self.now >= self.next {
                self.next += self.period;
                let output = module(Input {
                    encoder: self.sample(),
                    amplifier_fault: self.plant.fault(),
                    now: self.now,
                });
                (self.command, self.enable) = (output.command, output.enable);
            }
            self.plant.step(f64::from(self.command), self.enable);
            self.now += Plant::STEP;
        }
    }

    /// The module is switched off and on again: an encoder that counts begins at 0.
    pub fn restart(&mut self) {
        (self.command, self.enable) = (0.0, false);
        if let Encoder::Binary(_) = self.encoder {
            self.zero = self.plant.counts();
        }
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
        let number = (self.plant.counts() - self.zero) as u32 & self.encoder.width().max();
        match self.encoder {
            Encoder::Binary(_) => number,
            Encoder::Gray(_) => gray::from_binary(number),
        }
    }

    /// Until when time has passed.
    pub fn now(&self) -> Instant {
        self.now
    }

    /// The plant.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// As [`Hardware::plant`], to load it or to trip its amplifier.
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
