//! The grid of interpolated position.

use core::time::Duration;

/// Interpolation period (60C2h): a value and an exponent of ten, seconds. Value first, then exponent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Period {
    value: u8,
    exponent: i8,
}

impl Period {
    /// A period of exactly this time, with the highest exponent that does: 1 ms is 1 and -3. `None` where no value of 1 to 255
    /// and exponent of -6 to 0 gives it.
    pub fn new(time: Duration) -> Option<Self> {
        let micros =
            u32::try_from(time.as_micros()).ok().filter(|_| time.subsec_nanos().is_multiple_of(1_000))?;
        (-6..=0_i8).rev().find_map(|exponent| {
            let unit = 10_u32.pow(u32::from((exponent + 6).unsigned_abs()));
            let value = u8::try_from(micros / unit).ok()?;
            (value > 0 && micros.is_multiple_of(unit)).then_some(Self { value, exponent })
        })
    }

    /// What the two values of a drive stand for; `None` where the value is 0 or the exponent not -6 to 0.
    pub fn from_parts(value: u8, exponent: i8) -> Option<Self> {
        (value > 0 && (-6..=0).contains(&exponent)).then_some(Self { value, exponent })
    }

    /// 60C2h:1.
    pub const fn value(self) -> u8 {
        self.value
    }

    /// 60C2h:2.
    pub const fn exponent(self) -> i8 {
        self.exponent
    }

    /// The time.
    pub const fn time(self) -> Duration {
        let unit = 10_u64.pow((self.exponent + 6).unsigned_abs() as u32);
        Duration::from_micros(self.value as u64 * unit)
    }
}
