//! The motor: a speed loop with a torque limit on an inertia with dry friction, in steps of one millisecond.

use crate::profile::Profile;

/// Seconds of one step.
const STEP: f64 = 0.001;

/// Speed below which a motor counts as stopped, r/min.
const STANDSTILL: f64 = 0.5;

/// Pulses after which the position registers start again, see `puente_drives::edb::position_words`.
const POSITION_WRAP: f64 = 655_360_000.0;

/// What the drive makes the motor do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Power {
    /// No current: the motor coasts.
    Off,
    /// The speed loop follows the target, r/min.
    On(f64),
}

/// State of a motor.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Motor {
    /// r/min.
    pub speed: f64,
    /// The ramped speed reference, r/min.
    pub reference: f64,
    /// % of rated torque.
    pub torque: f64,
    /// Pulses.
    pub position: f64,
    /// Pulses that the motor is behind its reference.
    pub error: f64,
}

impl Motor {
    /// Whether a step would change nothing.
    pub fn at_rest(&self, power: Power) -> bool {
        let asked = matches!(power, Power::On(target) if target != 0.0);
        !asked && self.speed == 0.0 && self.reference == 0.0 && self.torque == 0.0
    }

    /// Lets one millisecond pass.
    pub fn step(&mut self, power: Power, profile: &Profile) {
        let before = self.speed;
        match power {
            Power::Off => self.coast(profile),
            Power::On(target) => self.follow(target, profile),
        }
        let pulses = |rpm: f64| rpm / 60.0 * f64::from(profile.pulses_per_turn) * STEP;
        self.position = wrap(self.position + pulses((before + self.speed) / 2.0));
        match power {
            Power::Off => self.error = 0.0,
            Power::On(_) if self.at_rest(power) => self.error = 0.0,
            Power::On(_) => self.error += pulses(self.reference - self.speed),
        }
    }

    fn coast(&mut self, profile: &Profile) {
        self.torque = 0.0;
        self.speed = toward_zero(self.speed, profile.friction / 100.0 * profile.rated_acceleration * STEP);
        self.reference = self.speed; // so that switching on while it coasts does not jump
    }

    fn follow(&mut self, target: f64, profile: &Profile) {
        let ramp = profile.ramp * STEP;
        let before = self.reference;
        self.reference += (target - before).clamp(-ramp, ramp);
        if self.reference == 0.0 && self.speed.abs() < STANDSTILL {
            self.speed = 0.0;
            self.torque = 0.0;
            return;
        }
        // The loop asks for the ramp's own acceleration plus what corrects the speed, against the friction.
        let wanted = (self.reference - before) / STEP + (before - self.speed) / profile.speed_loop;
        let direction = if self.reference == 0.0 { self.speed } else { self.reference };
        let friction = profile.friction * direction.signum();
        let torque = wanted / profile.rated_acceleration * 100.0 + friction;
        self.torque = torque.clamp(-profile.max_torque, profile.max_torque);
        self.speed += (self.torque - friction) / 100.0 * profile.rated_acceleration * STEP;
    }

    /// Moves the origin: the motor stands where it stood, its position now reads `pulses`.
    pub fn set_position(&mut self, pulses: i32) {
        self.position = wrap(f64::from(pulses));
    }
}

fn toward_zero(value: f64, by: f64) -> f64 {
    value.signum() * (value.abs() - by).max(0.0)
}

fn wrap(position: f64) -> f64 {
    (position + POSITION_WRAP / 2.0).rem_euclid(POSITION_WRAP) - POSITION_WRAP / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(motor: &mut Motor, power: Power, milliseconds: usize, profile: &Profile) {
        for _ in 0..milliseconds {
            motor.step(power, profile);
        }
    }

    #[test]
    fn speed_follows_the_ramp() {
        let profile = Profile::default(); // 5000 r/min per second: 1000 r/min after 200 ms
        let mut motor = Motor::default();
        run(&mut motor, Power::On(1_000.0), 100, &profile);
        assert!((495.0..=505.0).contains(&motor.speed), "{}", motor.speed);
        // 5000 of 10000 r/min per second, and the friction.
        assert!((54.0..=56.0).contains(&motor.torque), "{}", motor.torque);
        run(&mut motor, Power::On(1_000.0), 150, &profile);
        assert!((999.0..=1_001.0).contains(&motor.speed), "{}", motor.speed);
        assert!((4.0..=6.0).contains(&motor.torque), "friction alone: {}", motor.torque);
    }

    #[test]
    fn one_turn_is_its_pulses() {
        let profile = Profile { ramp: 1e9, max_torque: 1e9, ..Profile::default() };
        let mut motor = Motor::default();
        run(&mut motor, Power::On(60.0), 100, &profile);
        let start = motor.position;
        run(&mut motor, Power::On(60.0), 1_000, &profile);
        assert!((motor.position - start - 10_000.0).abs() < 1.0, "{}", motor.position - start);
    }

    #[test]
    fn a_weak_motor_lags_behind_its_reference() {
        let profile = Profile { max_torque: 20.0, ..Profile::default() };
        let mut motor = Motor::default();
        run(&mut motor, Power::On(1_000.0), 200, &profile);
        assert!(motor.speed <= 0.2 * 0.15 * 10_000.0 + 1.0, "20 % less 5 % friction: {}", motor.speed);
        assert_eq!(motor.torque, 20.0);
        assert!(motor.error > 1_000.0, "{}", motor.error);
    }

    #[test]
    fn stops_and_coasts_to_exact_rest() {
        let profile = Profile::default();
        for power in [Power::On(0.0), Power::Off] {
            for speed in [700.0, -700.0] {
                let mut motor = Motor { speed, reference: speed, ..Motor::default() };
                run(&mut motor, power, 3_000, &profile);
                assert!(motor.at_rest(power), "{motor:?}");
                assert_eq!(motor.error, 0.0);
                assert!(motor.position * speed > 0.0);
            }
        }
    }

    #[test]
    fn coasting_takes_longer_than_stopping() {
        let profile = Profile::default();
        let rolling = Motor { speed: 1_000.0, reference: 1_000.0, ..Motor::default() };
        let (mut stopping, mut coasting) = (rolling, rolling);
        run(&mut stopping, Power::On(0.0), 300, &profile);
        run(&mut coasting, Power::Off, 300, &profile);
        assert_eq!(stopping.speed, 0.0);
        assert!((840.0..=860.0).contains(&coasting.speed), "500 r/min per second: {}", coasting.speed);
    }

    #[test]
    fn position_wraps_where_the_registers_do() {
        assert_eq!(wrap(327_680_000.0), -327_680_000.0);
        assert_eq!(wrap(-327_680_001.0), 327_679_999.0);
    }
}
