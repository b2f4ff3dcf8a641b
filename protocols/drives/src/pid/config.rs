//! What a module is set to.

use core::fmt;
use core::time::Duration;

use super::control::Tuning;
use super::encoder::Tracker;
use super::{Encoder, Width};

/// A module's settings, beside the gains.
///
/// The thesis gives none of these figures; the values of [`Config::new`] are this project's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Config {
    /// Steps a second, 10 to 100 000; 10 000.
    pub rate: u32,
    /// What the encoder's samples are.
    pub encoder: Encoder,
    /// Faster than this the axis cannot be: an encoder that says so has jumped. Counts a second, at least 1; one million.
    /// In one step this must be less than half of the encoder's range.
    pub top_speed: u32,
    /// Time constant of the velocity filter, 0 to 1 s; 1 ms.
    pub filter: Duration,
    /// Most command, greater than 0, up to 1; 1.
    pub limit: f32,
    /// Most change of the command a second, greater than 0, in full scales; none. Not kept by a fault or a disable.
    pub slew: Option<f32>,
    /// An error of up to so many counts is none; 0.
    pub deadband: u32,
    /// How fast the reference goes to a set-point, counts a second, at least 1. None, the default: at once, so that a far
    /// set-point is a following error.
    pub speed: Option<u32>,
    /// Most following error, counts; 2000.
    pub following_error: u32,
    /// For how long the following error may be greater; up to 10 s; 50 ms.
    pub following_time: Duration,
    /// How long an enabled axis goes without a set-point; 1 ms to 10 s; 100 ms.
    pub communication: Duration,
    /// From the enable line to an amplifier under current: so long the command is 0 and the fault line is not looked at;
    /// up to 10 s; 20 ms. An amplifier of the ADS series stores a fault until it is enabled anew (maxon, ADS 50/5
    /// operating instructions, "Ready").
    pub start: Duration,
    /// Whether a positive command turns the encoder backwards.
    pub reversed: bool,
}

/// A setting out of its range; [`Config`] has the ranges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadConfig(
    /// Its name.
    pub &'static str,
);

impl fmt::Display for BadConfig {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is out of its range", self.0)
    }
}

impl Config {
    /// Settings for an encoder on a loop of 10 kHz.
    pub const fn new(encoder: Encoder) -> Self {
        Self {
            rate: 10_000,
            encoder,
            top_speed: 1_000_000,
            filter: Duration::from_millis(1),
            limit: 1.0,
            slew: None,
            deadband: 0,
            speed: None,
            following_error: 2_000,
            following_time: Duration::from_millis(50),
            communication: Duration::from_millis(100),
            start: Duration::from_millis(20),
            reversed: false,
        }
    }

    /// Whether a module can work with it: the first setting out of its range.
    pub fn check(&self) -> Result<(), BadConfig> {
        const LONG: Duration = Duration::from_secs(10);
        let positive = |number: f32| number > 0.0 && number.is_finite();
        let half = self.encoder.width().max() / 2;
        let checks = [
            ("rate", (10..=100_000).contains(&self.rate)),
            ("top_speed", self.top_speed > 0 && self.most_change() <= half),
            ("filter", self.filter <= Duration::from_secs(1)),
            ("limit", positive(self.limit) && self.limit <= 1.0),
            ("slew", self.slew.is_none_or(positive)),
            ("speed", self.speed != Some(0)),
            ("following_time", self.following_time <= LONG),
            ("communication", (Duration::from_millis(1)..=LONG).contains(&self.communication)),
            ("start", self.start <= LONG),
        ];
        checks.into_iter().find(|(_, good)| !good).map_or(Ok(()), |(name, _)| Err(BadConfig(name)))
    }

    /// Counts that the axis can go in one step.
    fn most_change(&self) -> u32 {
        self.top_speed.div_ceil(self.rate.max(1))
    }

    pub(super) fn tracker(&self) -> Tracker {
        let rate = self.rate as f32;
        let weight = 1.0 / (1.0 + self.filter.as_secs_f32() * rate);
        Tracker::new(self.encoder, self.most_change(), rate, weight)
    }

    pub(super) fn tuning(&self) -> Tuning {
        let period = 1.0 / self.rate as f32;
        // A change by 2 is from one end to the other.
        let slew = self.slew.map_or(2.0, |slew| slew * period);
        Tuning::new(period, self.deadband, self.limit, slew)
    }

    /// How far the reference goes in one step, in 2^-32 counts.
    pub(super) fn reference_step(&self) -> u64 {
        self.speed.map_or(u64::MAX, |speed| (u64::from(speed) << 32) / u64::from(self.rate.max(1)))
    }

    /// Steps that [`Config::following_time`] lasts.
    pub(super) fn following_steps(&self) -> u32 {
        let micros = self.following_time.as_micros().try_into().unwrap_or(u64::MAX);
        let steps = micros.saturating_mul(u64::from(self.rate)) / 1_000_000;
        steps.try_into().unwrap_or(u32::MAX)
    }
}

impl Default for Config {
    /// For a 16-bit timer.
    fn default() -> Self {
        Self::new(Encoder::Binary(Width::W16))
    }
}
