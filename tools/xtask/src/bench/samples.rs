//! Figures of a measurement.

use std::time::Duration;

/// Durations, ascending.
#[derive(Clone, Debug)]
pub struct Samples(Vec<Duration>);

impl Samples {
    /// Takes durations in any order.
    ///
    /// # Errors
    /// There are fewer than ten: too few to tell anything.
    pub fn new(mut durations: Vec<Duration>) -> Result<Self, String> {
        if durations.len() < 10 {
            return Err(format!("only {} samples", durations.len()));
        }
        durations.sort_unstable();
        Ok(Self(durations))
    }

    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// The smallest sample that `percent` of all do not exceed (nearest rank).
    pub fn percentile(&self, percent: usize) -> Duration {
        let rank = (self.0.len() * percent).div_ceil(100).max(1);
        self.0[rank.min(self.0.len()) - 1]
    }

    pub fn median(&self) -> Duration {
        self.percentile(50)
    }
}

/// Milliseconds with three digits behind the point.
pub fn ms(duration: Duration) -> String {
    format!("{:.3}", duration.as_secs_f64() * 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_samples_of_their_rank() {
        let samples = Samples::new((1..=100).rev().map(Duration::from_micros).collect()).expect("enough");
        assert_eq!(samples.count(), 100);
        for (percent, micros) in [(0, 1), (1, 1), (50, 50), (99, 99), (100, 100)] {
            assert_eq!(samples.percentile(percent), Duration::from_micros(micros), "{percent}");
        }
        assert!(Samples::new(vec![Duration::ZERO; 9]).is_err());
    }
}
