//! The gains of the loop.

use core::fmt;

/// Gains that the loop can work with: finite, and no less than 0.
///
/// The thesis sends them as decimal text and keeps them as floats; their units are this project's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gains {
    kp: f32,
    ki: f32,
    kd: f32,
}

/// A gain that the loop cannot work with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BadGain {
    /// Which one: `kp`, `ki` or `kd`.
    pub name: &'static str,
    /// What it was to be.
    pub value: f32,
}

impl fmt::Display for BadGain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Without the value, for the code that writes a float takes more room than a controller may have.
        write!(f, "{} must be a number from 0 to 1000000", self.name)
    }
}

impl Gains {
    /// The greatest gain. One count of error times a millionth of it is full scale already; with it no product of the
    /// loop can leave the range of an f32.
    pub const MAX: f32 = 1e6;

    /// Gains, each 0 to [`Gains::MAX`]:
    /// - `kp`: command a count of error,
    /// - `ki`: command a second, a count of error,
    /// - `kd`: command a count a second of velocity.
    ///
    /// NaN and the infinities are refused, and so are negative numbers: they would drive the axis away from its
    /// set-point. The sense of an amplifier is [`Config::reversed`](super::Config::reversed).
    pub fn new(kp: f32, ki: f32, kd: f32) -> Result<Self, BadGain> {
        for (name, value) in [("kp", kp), ("ki", ki), ("kd", kd)] {
            if !(0.0..=Self::MAX).contains(&value) {
                return Err(BadGain { name, value });
            }
        }
        Ok(Self { kp, ki, kd })
    }

    /// Command a count of error.
    pub const fn kp(self) -> f32 {
        self.kp
    }

    /// Command a second, a count of error.
    pub const fn ki(self) -> f32 {
        self.ki
    }

    /// Command a count a second of velocity.
    pub const fn kd(self) -> f32 {
        self.kd
    }

    /// Whether they hold an axis where it is: whether Kp is not 0. The gains at power-up do not.
    pub fn hold(self) -> bool {
        self.kp > 0.0
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn only_numbers_from_zero_up() {
        assert_eq!(Gains::new(0.0, 0.0, 0.0), Ok(Gains::default()));
        let gains = Gains::new(Gains::MAX, 2.5, 1e-9).expect("gains");
        assert_eq!((gains.kp(), gains.ki(), gains.kd()), (1e6, 2.5, 1e-9));
        assert!(gains.hold() && !Gains::default().hold());
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e-9, 1.01e6] {
            assert_eq!(Gains::new(bad, 0.0, 0.0).expect_err("kp").name, "kp");
            assert_eq!(Gains::new(0.0, bad, 0.0).expect_err("ki").name, "ki");
            assert_eq!(Gains::new(0.0, 0.0, bad).expect_err("kd").name, "kd");
        }
        let error = Gains::new(0.0, f32::NAN, 0.0).expect_err("NaN");
        assert_eq!(error.to_string(), "ki must be a number from 0 to 1000000");
        assert_eq!(Gains::new(-0.0, 1.0, 1.0).map(Gains::hold), Ok(false));
    }
}
