//! Positions of a few bits that start again at their end, made wide.

/// Bits of a counter or of a code, 1 to 32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width(u8);

impl Width {
    /// A 16-bit timer.
    pub const W16: Self = Self(16);
    /// A 32-bit timer.
    pub const W32: Self = Self(32);

    /// A width; `None` unless it is 1 to 32 bits.
    pub const fn new(bits: u8) -> Option<Self> {
        if matches!(bits, 1..=32) { Some(Self(bits)) } else { None }
    }

    /// Bits, 1 to 32.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The greatest value.
    pub const fn max(self) -> u32 {
        u32::MAX >> self.unused()
    }

    /// How far from one value to another, the short way round; from half of all values away, backwards.
    pub const fn change(self, from: u32, to: u32) -> i32 {
        (to.wrapping_sub(from) << self.unused()).cast_signed() >> self.unused()
    }

    const fn unused(self) -> u32 {
        32 - self.0 as u32
    }
}

/// A position that follows a counter or a code over its end in both directions.
///
/// Between two samples the value must have changed by less than half of its range. The position never ends: at ten
/// million counts a second an i64 lasts for 29 thousand years.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wide {
    width: Width,
    raw: u32,
    position: i64,
}

impl Wide {
    /// A position that begins at the value `raw`; bits above the width are dropped.
    pub const fn new(width: Width, raw: u32) -> Self {
        let raw = raw & width.max();
        Self { width, raw, position: raw as i64 }
    }

    /// Takes a sample. Returns how far the position has gone since the last one.
    pub const fn sample(&mut self, raw: u32) -> i32 {
        let change = self.width.change(self.raw, raw);
        self.raw = raw;
        self.position = self.position.wrapping_add(change as i64);
        change
    }

    /// The position at the last sample, counts.
    pub const fn position(&self) -> i64 {
        self.position
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn widths() {
        assert_eq!((Width::new(0), Width::new(33)), (None, None));
        assert_eq!(Width::new(1).map(Width::max), Some(1));
        assert_eq!((Width::W16.max(), Width::W32.max()), (0xFFFF, u32::MAX));
        assert_eq!(Width::W16.bits(), 16);
    }

    #[test]
    fn over_the_end_of_a_16_bit_timer_and_back() {
        let mut position = Wide::new(Width::W16, 0);
        assert_eq!((position.sample(0xFFFE), position.position()), (-2, -2));
        assert_eq!((position.sample(3), position.position()), (5, 3));
        assert_eq!((position.sample(0x7FFF), position.position()), (0x7FFC, 0x7FFF));
        assert_eq!((position.sample(0xFFFE), position.position()), (0x7FFF, 0xFFFE));
        assert_eq!((position.sample(0x0001), position.position()), (3, 0x1_0001));
        // Half of the range away is ambiguous; it counts as backwards.
        assert_eq!((position.sample(0x8001), position.position()), (-0x8000, 0x8001));
    }

    #[test]
    fn a_32_bit_timer_takes_steps_of_almost_half() {
        let mut position = Wide::new(Width::W32, u32::MAX);
        assert_eq!(position.sample(0x7FFF_FFFE), i32::MAX);
        assert_eq!(position.position(), 0x1_7FFF_FFFE);
        assert_eq!(position.sample(u32::MAX), i32::MIN + 1);
        assert_eq!(position.position(), 0xFFFF_FFFF);
    }

    proptest! {
        #[test]
        fn follows_any_walk(
            bits in 2..=32_u8,
            start in any::<u32>(),
            walk in prop::collection::vec(any::<i32>(), 0..50),
        ) {
            let width = Width::new(bits).expect("width");
            let most = i64::from(width.max() / 2);
            let mut truth = i64::from(start & width.max());
            let mut position = Wide::new(width, start);
            for step in walk {
                let step = i64::from(step) % (most + 1);
                truth += step;
                prop_assert_eq!(i64::from(position.sample(truth as u32 & width.max())), step);
                prop_assert_eq!(position.position(), truth);
            }
        }
    }
}
