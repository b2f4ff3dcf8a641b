//! Bits that the line turns round.

use puente_framed::Random;

/// Turns bits of what receivers hear round, each with the same probability, whatever the others do.
pub(crate) struct Noise {
    probability: f64,
    random: Random,
    /// Bits that will pass before the next wrong one.
    ahead: u64,
    pub flipped: u64,
}

impl Noise {
    pub fn new(probability: f64, seed: u64) -> Self {
        let mut noise = Self { probability, random: Random::new(seed), ahead: 0, flipped: 0 };
        noise.ahead = noise.distance();
        noise
    }

    /// From now on with another probability.
    pub fn set(&mut self, probability: f64) {
        self.probability = probability;
        self.ahead = self.distance();
    }

    /// Whether the next `bits` all pass; they have, then.
    pub fn pass(&mut self, bits: u64) -> bool {
        let quiet = self.ahead >= bits;
        if quiet {
            self.ahead -= bits;
        }
        quiet
    }

    /// The wrong ones of the next `bits`, as a mask.
    pub fn strike(&mut self, bits: u32) -> u32 {
        let mut mask = 0;
        let mut at = 0;
        while self.ahead < u64::from(bits - at) {
            at += self.ahead as u32;
            mask |= 1 << at;
            at += 1;
            self.flipped += 1;
            self.ahead = self.distance();
        }
        self.ahead -= u64::from(bits - at);
        mask
    }

    /// Geometrically distributed.
    fn distance(&mut self) -> u64 {
        if self.probability <= 0.0 {
            return u64::MAX;
        }
        let uniform = (f64::from(self.random.next()) + 1.0) / (f64::from(u32::MAX) + 1.0);
        (uniform.ln() / (1.0 - self.probability).ln()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_turned_as_often_as_asked_for() {
        let mut noise = Noise::new(1e-3, 7);
        let mut count = 0;
        for _ in 0..100_000 {
            if !noise.pass(10) {
                count += noise.strike(10).count_ones();
            }
        }
        assert!((900..1_100).contains(&count), "{count}");
        assert_eq!(u64::from(count), noise.flipped);
        let mut quiet = Noise::new(0.0, 7);
        assert!((0..1_000).all(|_| quiet.pass(1 << 32)));
    }
}
