//! The arithmetic of the loop, as the [module documentation](super) gives it.

use super::Gains;

/// What the loop multiplies and compares with, made ready at construction and when the gains change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tuning {
    /// Seconds.
    period: f32,
    kp: f32,
    /// Ki T: what one step of an error of one count adds to the integral.
    ki: f32,
    kd: f32,
    /// Counts.
    deadband: u32,
    /// Of the command, greater than 0.
    limit: f32,
    /// Most change of the command in one step.
    slew: f32,
}

impl Tuning {
    pub const fn new(period: f32, deadband: u32, limit: f32, slew: f32) -> Self {
        Self { period, kp: 0.0, ki: 0.0, kd: 0.0, deadband, limit, slew }
    }

    pub fn set_gains(&mut self, gains: Gains) {
        self.kp = gains.kp();
        self.ki = gains.ki() * self.period;
        self.kd = gains.kd();
    }
}

/// The loop's memory. A new one has nothing integrated and commands 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Control {
    integral: f32,
    command: f32,
}

impl Control {
    /// One step: error in counts, velocity in counts a second. Returns the command.
    #[inline]
    pub fn step(&mut self, tuning: &Tuning, error: i32, velocity: f32) -> f32 {
        let error = if error.unsigned_abs() <= tuning.deadband { 0.0 } else { error as f32 };
        let integral = within(self.integral + tuning.ki * error, -tuning.limit, tuning.limit);
        let wanted = tuning.kp * error + integral - tuning.kd * velocity;
        let limited = within(wanted, -tuning.limit, tuning.limit);
        let command = within(limited, self.command - tuning.slew, self.command + tuning.slew);
        // Held back, and the error asks for more of the same: what is integrated now would have to be undone.
        if (wanted - command) * error <= 0.0 {
            self.integral = integral;
        }
        self.command = command;
        command
    }
}

/// `value` between `low` and `high`. Without the panic of `clamp`, and without calls on cores that have no instruction
/// for the minimum.
#[inline]
fn within(value: f32, low: f32, high: f32) -> f32 {
    if value > high {
        high
    } else if value < low {
        low
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// 1 kHz, no slew limit.
    fn tuning(kp: f32, ki: f32, kd: f32) -> Tuning {
        let mut tuning = Tuning::new(0.001, 0, 1.0, 2.0);
        tuning.set_gains(Gains::new(kp, ki, kd).expect("gains"));
        tuning
    }

    #[test]
    fn each_term_alone() {
        assert_eq!(Control::default().step(&tuning(0.25, 0.0, 0.0), 2, 100.0), 0.5);
        assert_eq!(Control::default().step(&tuning(0.0, 0.0, 0.125), 2, 2.0), -0.25);
        let mut control = Control::default();
        let integral = tuning(0.0, 125.0, 0.0);
        assert_eq!([2, 2, -1, 0].map(|error| control.step(&integral, error, 9.0)), [0.25, 0.5, 0.375, 0.375]);
    }

    #[test]
    fn the_deadband_holds_what_is_integrated() {
        let mut tuning = tuning(0.125, 125.0, 0.0);
        tuning.deadband = 3;
        let mut control = Control::default();
        assert_eq!(control.step(&tuning, 3, 0.0), 0.0);
        assert_eq!(control.step(&tuning, -3, 0.0), 0.0);
        assert_eq!(control.step(&tuning, 4, 0.0), 1.0, "outside, the error counts as it is");
        assert_eq!(control.step(&tuning, 1, 0.0), 0.5);
        assert_eq!(control.step(&tuning, -4, 0.0), -0.5);
    }

    #[test]
    fn a_held_command_is_not_integrated_upon() {
        let tuning = tuning(0.5, 125.0, 0.0);
        let mut control = Control::default();
        for _ in 0..10_000 {
            assert_eq!(control.step(&tuning, 4, 0.0), 1.0);
        }
        assert_eq!(control.integral, 0.0);
        // The error turns: the command follows at once.
        assert_eq!(control.step(&tuning, -1, 0.0), -0.625);
        // An error that leads out of the limit is integrated, even while the derivative holds the command there.
        let braking = Tuning { kd: 1.0, ..tuning };
        assert_eq!(control.step(&braking, 1, 5.0), -1.0);
        assert_eq!(control.integral, 0.0);
    }

    #[test]
    fn a_command_that_slews_is_not_integrated_upon() {
        let tuning = Tuning { slew: 0.25, ..tuning(0.25, 125.0, 0.0) };
        let mut control = Control::default();
        assert_eq!([2, 2, 2].map(|error| control.step(&tuning, error, 0.0)), [0.25, 0.5, 0.75]);
        assert_eq!(control.integral, 0.25, "only the last two steps were not held back");
        assert_eq!([0, 0, 0].map(|error| control.step(&tuning, error, 0.0)), [0.5, 0.25, 0.25]);
    }

    #[test]
    fn the_integral_ends_at_the_limit() {
        let mut tuning = tuning(0.0, 100.0, 0.0);
        tuning.limit = 0.5;
        let mut control = Control::default();
        for _ in 0..100 {
            control.step(&tuning, 1, 0.0);
        }
        assert_eq!((control.command, control.integral), (0.5, 0.5));
    }

    proptest! {
        #[test]
        fn the_command_is_finite_and_within_its_bounds(
            gains in prop::array::uniform3(0.0..=Gains::MAX),
            deadband in any::<u32>(),
            limit in 1e-6..=1.0_f32,
            slew in 1e-9..=2.0_f32,
            inputs in prop::collection::vec((any::<i32>(), -2.2e14..=2.2e14_f32), 1..50),
        ) {
            let [kp, ki, kd] = gains;
            let mut tuning = Tuning::new(0.1, deadband, limit, slew);
            tuning.set_gains(Gains::new(kp, ki, kd).expect("gains"));
            let mut control = Control::default();
            let mut before = 0.0;
            for (error, velocity) in inputs {
                let command = control.step(&tuning, error, velocity);
                prop_assert!(command.abs() <= limit && control.integral.abs() <= limit);
                prop_assert!((command - before).abs() <= slew * 1.001 + f32::EPSILON);
                before = command;
            }
        }
    }
}
