//! Numbers of a window's frames.

/// 0 to 4095, counted modulo 4096.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Number(u16);

impl Number {
    /// What a session begins with.
    pub const ZERO: Self = Self(0);

    /// `value` modulo 4096.
    pub const fn new(value: u16) -> Self {
        Self(value & 0x0FFF)
    }

    /// 0 to 4095.
    pub const fn value(self) -> u16 {
        self.0
    }

    /// The number `count` later.
    pub const fn plus(self, count: u8) -> Self {
        Self::new(self.0.wrapping_add(count as u16))
    }

    /// How much later this is than `earlier`, 0 to 4095.
    pub const fn since(self, earlier: Self) -> u16 {
        self.0.wrapping_sub(earlier.0) & 0x0FFF
    }

    /// From its lower four bits, which the tag holds, and its upper eight.
    pub(crate) const fn join(lower: u8, upper: u8) -> Self {
        Self((upper as u16) << 4 | (lower & 0x0F) as u16)
    }

    /// Its lower four bits and its upper eight.
    pub(crate) const fn split(self) -> (u8, u8) {
        (self.0 as u8 & 0x0F, (self.0 >> 4) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_go_round() {
        for from in 0..4_096 {
            let number = Number::new(from);
            for count in [0, 1, 8, 255] {
                assert_eq!(number.plus(count).since(number), count.into());
            }
            let (lower, upper) = number.split();
            assert_eq!(Number::join(lower, upper), number);
        }
        assert_eq!(Number::new(4_096), Number::ZERO);
    }
}
