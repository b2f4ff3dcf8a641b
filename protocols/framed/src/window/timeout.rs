//! How long to wait for an acknowledgement (RFC 6298, clauses 2 and 5.5).

use core::time::Duration;

use super::Config;

#[derive(Clone, Copy, Debug)]
pub(super) struct Timeout {
    /// Smoothed round-trip time and its mean deviation, once there is a sample.
    estimate: Option<(Duration, Duration)>,
    /// Timeouts in a row, each of which doubles the wait.
    doublings: u32,
}

impl Timeout {
    pub const fn new() -> Self {
        Self { estimate: None, doublings: 0 }
    }

    /// A round-trip time. Only of frames sent once: of others nobody knows which copy was acknowledged (Karn).
    pub fn sample(&mut self, time: Duration) {
        self.estimate = Some(match self.estimate {
            None => (time, time / 2),
            Some((smoothed, deviation)) => {
                let error = smoothed.abs_diff(time);
                ((smoothed * 7 + time) / 8, (deviation * 3 + error) / 4)
            }
        });
    }

    /// Something new was acknowledged.
    pub fn progress(&mut self) {
        self.doublings = 0;
    }

    /// The wait was in vain.
    pub fn expired(&mut self) {
        self.doublings = self.doublings.saturating_add(1).min(16);
    }

    pub fn wait(&self, config: &Config) -> Duration {
        let wait = match self.estimate {
            Some((smoothed, deviation)) => smoothed.saturating_add(deviation.saturating_mul(4)),
            None => config.first_timeout,
        };
        wait.max(config.min_timeout).saturating_mul(1 << self.doublings).min(config.max_timeout)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config() -> Config {
        let line = puente_line::Settings { baud: 1_000_000, format: "8N1".parse().expect("format") };
        Config {
            first_timeout: Duration::from_millis(100),
            min_timeout: Duration::from_millis(1),
            max_timeout: Duration::from_secs(1),
            ..Config::new(line, 64)
        }
    }

    /// The figures are those of the formulas of RFC 6298, computed by hand.
    #[test]
    fn the_wait_follows_the_round_trip_time() {
        let config = config();
        let mut timeout = Timeout::new();
        assert_eq!(timeout.wait(&config), Duration::from_millis(100));
        timeout.sample(Duration::from_millis(8));
        assert_eq!(timeout.wait(&config), Duration::from_millis(8 + 4 * 4));
        timeout.sample(Duration::from_millis(16));
        // 8 + (16 - 8) / 8 = 9; 4 + (8 - 4) / 4 = 5.
        assert_eq!(timeout.wait(&config), Duration::from_millis(9 + 4 * 5));
        timeout.expired();
        timeout.expired();
        assert_eq!(timeout.wait(&config), Duration::from_millis(4 * 29));
        timeout.progress();
        assert_eq!(timeout.wait(&config), Duration::from_millis(29));
    }

    #[test]
    fn the_wait_has_bounds() {
        let config = config();
        let mut timeout = Timeout::new();
        for _ in 0..100 {
            timeout.sample(Duration::ZERO);
        }
        assert_eq!(timeout.wait(&config), config.min_timeout);
        for _ in 0..100 {
            timeout.expired();
        }
        assert_eq!(timeout.wait(&config), config.max_timeout);
        timeout.sample(Duration::MAX / 16);
        assert_eq!(timeout.wait(&config), config.max_timeout);
    }
}
