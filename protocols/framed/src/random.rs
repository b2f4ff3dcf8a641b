//! Numbers that nobody foresees, from a seed.

/// SplitMix64: small and quick. It keeps stations from doing the same thing; it keeps no secrets.
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Two stations need two seeds, and a station another one at each start.
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Any number, all alike.
    pub const fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((mixed ^ (mixed >> 31)) >> 32) as u32
    }

    /// Any number below 2^`bits`, at most 32 bits.
    pub const fn bits(&mut self, bits: u32) -> u32 {
        match bits {
            0 => 0,
            1..32 => self.next() >> (32 - bits),
            _ => self.next(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of many draws each value comes up about as often as every other.
    #[test]
    fn draws_are_even() {
        let mut random = Random::new(1);
        let mut count = [0_u32; 8];
        for _ in 0..80_000 {
            count[random.bits(3) as usize] += 1;
        }
        assert!(count.iter().all(|count| (9_600..10_400).contains(count)), "{count:?}");
        assert_eq!(random.bits(0), 0);
    }
}
