//! Bit timing: how a controller divides its clock.

/// Where bits are sampled, in thousandths of the bit: the thesis' table 30, which is that of CiA 301 version 4.02 as
/// remembered. Version 4.2.0 asks for 87.5 % at every bit rate.
const SAMPLE_POINTS: [(u32, u32); 2] = [(1_000_000, 750), (800_000, 800)];
const SAMPLE_POINT: u32 = 875;

/// Least quanta of a bit (ISO 11898-1).
const LEAST_QUANTA: u32 = 8;

/// What a controller can do.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Greatest divider of its clock.
    pub prescaler: u16,
    /// Most quanta before the sample point, without the first one.
    pub before: u8,
    /// Most quanta after it.
    pub after: u8,
    /// Most quanta that a bit is lengthened or shortened by.
    pub jump: u8,
}

/// bxCAN (RM0090, CAN_BTR).
#[cfg(any(test, not(feature = "nucleo-h753zi")))]
pub const BXCAN: Limits = Limits { prescaler: 1024, before: 16, after: 8, jump: 4 };
/// FDCAN (RM0433, FDCAN_NBTP), of which no more than this is of use.
#[cfg(any(test, feature = "nucleo-h753zi"))]
pub const FDCAN: Limits = Limits { prescaler: 512, before: 200, after: 50, jump: 50 };

/// How a bit is made up of quanta.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// Periods of the clock in a quantum.
    pub prescaler: u16,
    /// Quanta before the sample point, without the first one, which is always there.
    pub before: u8,
    /// Quanta after it.
    pub after: u8,
    /// Quanta that a bit is lengthened or shortened by, to stay with its sender.
    pub jump: u8,
}

impl Timing {
    /// The timing whose bit rate is exact and whose sample point is nearest to the one wanted; the one with the most quanta,
    /// where there are several. `None` where no timing is exact.
    pub fn new(clock: u32, bitrate: u32, limits: Limits) -> Option<Self> {
        let wanted = sample_point(bitrate);
        let mut best: Option<(u32, Self)> = None;
        for quanta in (LEAST_QUANTA..=1 + u32::from(limits.before) + u32::from(limits.after)).rev() {
            let rate = bitrate.checked_mul(quanta)?;
            if rate == 0 || !clock.is_multiple_of(rate) || clock / rate > limits.prescaler.into() {
                continue;
            }
            let least = quanta.saturating_sub(1 + u32::from(limits.before)).max(1);
            // To the nearest, and the later one of two: a cable may be longer then.
            let after = ((1000 - wanted) * quanta + 499) / 1000;
            let after = after.clamp(least, u32::from(limits.after).min(quanta - 2));
            let timing = Self {
                prescaler: (clock / rate) as u16,
                before: (quanta - 1 - after) as u8,
                after: after as u8,
                jump: (after as u8 / 2).clamp(1, limits.jump),
            };
            let error = timing.sample_point().abs_diff(wanted);
            if best.is_none_or(|(least, _)| error < least) {
                best = Some((error, timing));
            }
        }
        best.map(|(_, timing)| timing)
    }

    /// Quanta of a bit.
    pub const fn quanta(self) -> u32 {
        1 + self.before as u32 + self.after as u32
    }

    /// Where the bit is sampled, in thousandths, rounded down.
    pub const fn sample_point(self) -> u32 {
        (1 + self.before as u32) * 1000 / self.quanta()
    }
}

/// Where the bits of a bit rate are to be sampled, in thousandths.
fn sample_point(bitrate: u32) -> u32 {
    SAMPLE_POINTS.iter().find(|(rate, _)| *rate == bitrate).map_or(SAMPLE_POINT, |(_, point)| *point)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::BIT_RATES;

    const H7: u32 = 80_000_000;
    const F7: u32 = 54_000_000;
    const F4: u32 = 42_000_000;

    /// In kbit/s: prescaler, quanta, sample point in thousandths.
    fn all(clock: u32, limits: Limits) -> Vec<(u32, u16, u32, u32)> {
        let timing = |rate: &u32| {
            let timing = Timing::new(clock, *rate, limits)?;
            Some((*rate / 1000, timing.prescaler, timing.quanta(), timing.sample_point()))
        };
        BIT_RATES.iter().filter_map(timing).collect()
    }

    /// The table in docs/boards.md.
    #[test]
    fn the_boards_have_these_timings() {
        assert_eq!(
            all(H7, FDCAN),
            [
                (10, 40, 200, 875),
                (20, 20, 200, 875),
                (50, 8, 200, 875),
                (100, 4, 200, 875),
                (125, 4, 160, 875),
                (250, 2, 160, 875),
                (500, 1, 160, 875),
                (800, 1, 100, 800),
                (1000, 1, 80, 750)
            ]
        );
        assert_eq!(
            all(F7, BXCAN),
            [
                (10, 675, 8, 875),
                (20, 180, 15, 866),
                (50, 135, 8, 875),
                (100, 36, 15, 866),
                (125, 27, 16, 875),
                (250, 27, 8, 875),
                (500, 6, 18, 888),
                (1000, 3, 18, 777)
            ]
        );
        assert_eq!(
            all(F4, BXCAN),
            [
                (10, 525, 8, 875),
                (20, 140, 15, 866),
                (50, 105, 8, 875),
                (100, 28, 15, 866),
                (125, 21, 16, 875),
                (250, 21, 8, 875),
                (500, 6, 14, 857),
                (1000, 2, 21, 761)
            ]
        );
    }

    /// The controllers that CiA 301 was written for have 8 MHz: then these are its own quanta (table 30).
    #[test]
    fn at_8_mhz_the_quanta_are_those_of_the_standard() {
        let quanta = |rate| {
            let timing = Timing::new(8_000_000, rate, BXCAN).expect("a timing");
            (timing.quanta(), 1 + timing.before)
        };
        assert_eq!(quanta(1_000_000), (8, 6));
        assert_eq!(quanta(800_000), (10, 8));
        for rate in [500_000, 250_000, 125_000, 50_000, 20_000, 10_000] {
            assert_eq!(quanta(rate), (16, 14), "{rate}");
        }
    }

    #[test]
    fn what_is_not_exact_is_none() {
        assert_eq!(Timing::new(F7, 800_000, BXCAN), None);
        assert_eq!(Timing::new(F4, 800_000, BXCAN), None);
        assert_eq!(Timing::new(F4, 0, BXCAN), None);
        assert_eq!(Timing::new(F4, u32::MAX, BXCAN), None);
        assert_eq!(Timing::new(F4, 83_333, BXCAN), None);
    }

    proptest::proptest! {
        /// Whatever the clock, what is found is exact and within the limits.
        #[test]
        fn timings_are_exact_and_possible(clock in 1_000_000..200_000_000u32, rate in 5_000..1_000_001u32) {
            for limits in [BXCAN, FDCAN] {
                let Some(timing) = Timing::new(clock / rate * rate, rate, limits) else { continue };
                let bit = u32::from(timing.prescaler) * timing.quanta();
                proptest::prop_assert_eq!(clock / rate * rate, bit * rate);
                proptest::prop_assert!((1..=limits.prescaler).contains(&timing.prescaler));
                proptest::prop_assert!((1..=limits.before).contains(&timing.before));
                proptest::prop_assert!((1..=limits.after).contains(&timing.after));
                proptest::prop_assert!((1..=limits.jump.min(timing.after)).contains(&timing.jump));
                proptest::prop_assert!(timing.quanta() >= LEAST_QUANTA);
            }
        }
    }
}
