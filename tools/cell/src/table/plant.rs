//! Motor, amplifier, mechanics and encoder of an axis.

use std::f64::consts::TAU;
use std::time::Duration;

use super::{Amplifier, AxisProfile};

/// Seconds of one step.
const STEP: f64 = 10e-6;

/// An axis without its module: from the amplifier's input to the encoder.
///
/// ```text
/// current    = first-order lag behind what the mode asks for, within the amplifier's current and the supply's voltage
/// inertia w' = constant current - viscous w - dry friction - load
/// ```
#[derive(Clone, Debug)]
pub struct Plant {
    profile: AxisProfile,
    /// Share of its lag that the current keeps through a step.
    decay: f64,
    /// End stops, rad.
    travel: (f64, f64),
    /// A.
    current: f64,
    /// rad/s.
    speed: f64,
    /// rad.
    angle: f64,
    /// N·m.
    load: f64,
    enabled: bool,
    cause: bool,
    tripped: bool,
}

impl Plant {
    /// The time of one step.
    pub const STEP: Duration = Duration::from_micros(10);

    /// At rest in the middle of count 0, its amplifier disabled.
    pub fn new(profile: &AxisProfile) -> Self {
        let angle = |counts: i64| counts as f64 * TAU / f64::from(profile.counts_per_turn);
        Self {
            profile: *profile,
            decay: (-STEP / profile.current_loop).exp(),
            travel: (angle(profile.travel.0), angle(profile.travel.1)),
            current: 0.0,
            speed: 0.0,
            angle: angle(1) / 2.0,
            load: 0.0,
            enabled: false,
            cause: false,
            tripped: false,
        }
    }

    /// Lets one step pass with the amplifier's input at `command` (-1 to 1) and its enable line as given.
    pub fn step(&mut self, command: f64, enable: bool) {
        if enable && !self.enabled {
            // A stored fault is forgotten where its cause is gone.
            self.tripped = false;
        }
        self.enabled = enable;
        self.tripped |= self.cause;
        let before = self.current;
        self.current = if enable && !self.tripped {
            let wanted = self.wanted(command.clamp(-1.0, 1.0));
            wanted + (before - wanted) * self.decay
        } else {
            0.0
        };
        self.turn((before + self.current) / 2.0);
    }

    /// The current that the amplifier drives at, A.
    fn wanted(&self, command: f64) -> f64 {
        let profile = &self.profile;
        let asked = match profile.amplifier {
            Amplifier::Speed { full, gain } => (command * full - self.speed) * gain,
            Amplifier::Current { full } => command * full,
        };
        let back = profile.motor.constant * self.speed;
        let most = (profile.supply - back) / profile.motor.resistance;
        let least = (-profile.supply - back) / profile.motor.resistance;
        asked.clamp(-profile.max_current, profile.max_current).min(most).max(least)
    }

    fn turn(&mut self, current: f64) {
        let motor = self.profile.motor;
        let drive = motor.constant * current - self.load;
        let before = self.speed;
        let friction = if before != 0.0 { before.signum() } else { drive.signum() } * motor.coulomb;
        self.speed = if before == 0.0 && drive.abs() <= motor.coulomb {
            0.0
        } else {
            // The mean speed of the step in the viscous term: exact to second order.
            let slowing = motor.viscous * STEP / (2.0 * motor.inertia);
            let after =
                (before * (1.0 - slowing) + (drive - friction) * STEP / motor.inertia) / (1.0 + slowing);
            // Dry friction stops, it does not turn round.
            if before * after < 0.0 { 0.0 } else { after }
        };
        self.angle += (before + self.speed) / 2.0 * STEP;
        let (low, high) = self.travel;
        if !(low..=high).contains(&self.angle) {
            self.angle = self.angle.clamp(low, high);
            self.speed = 0.0;
        }
    }

    /// What the encoder counts, x4.
    pub fn counts(&self) -> i64 {
        self.position().floor() as i64
    }

    /// Where the axis is, in counts and parts of them.
    pub fn position(&self) -> f64 {
        self.angle / TAU * f64::from(self.profile.counts_per_turn)
    }

    /// The encoder's tracks A and B; A leads when the position grows.
    pub fn tracks(&self) -> (bool, bool) {
        let quarter = self.counts().rem_euclid(4);
        (matches!(quarter, 1 | 2), matches!(quarter, 2 | 3))
    }

    /// Counts a second.
    pub fn velocity(&self) -> f64 {
        self.speed / TAU * f64::from(self.profile.counts_per_turn)
    }

    /// A.
    pub fn current(&self) -> f64 {
        self.current
    }

    /// Whether the amplifier says that it is not ready. It stores a fault until it is enabled anew (maxon, ADS 50/5
    /// operating instructions, "Ready").
    pub fn fault(&self) -> bool {
        self.tripped
    }

    /// Makes the amplifier trip, for as long as the cause is present.
    pub fn set_fault(&mut self, present: bool) {
        self.cause = present;
    }

    /// A torque against the positive direction, N·m: the weight of a vertical axis, or a tool.
    pub fn set_load(&mut self, load: f64) {
        self.load = load;
    }
}
