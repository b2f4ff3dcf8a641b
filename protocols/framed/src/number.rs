//! Numbers of a window's frames.

/// 0 to 15, counted modulo 16.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Number(u8);

impl Number {
    /// What a session begins with.
    pub const ZERO: Self = Self(0);

    /// `value` modulo 16.
    pub const fn new(value: u8) -> Self {
        Self(value & 0x0F)
    }

    /// 0 to 15.
    pub const fn value(self) -> u8 {
        self.0
    }

    /// The number `count` later.
    pub const fn plus(self, count: u8) -> Self {
        Self::new(self.0.wrapping_add(count))
    }

    /// How much later this is than `earlier`, 0 to 15.
    pub const fn since(self, earlier: Self) -> u8 {
        self.0.wrapping_sub(earlier.0) & 0x0F
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_go_round() {
        for from in 0..16 {
            for count in 0..16 {
                let number = Number::new(from);
                assert_eq!(number.plus(count).since(number), count);
            }
        }
        assert_eq!(Number::new(16), Number::ZERO);
    }
}
