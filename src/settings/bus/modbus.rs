//! What a Modbus bus has.

use puente_line::{Format, Parity, Settings as Line};
use serde::Deserialize;

use super::super::check::Range;
use super::{Echo, compact_line};
use crate::desk::Units;

/// What a Modbus bus has.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Modbus {
    /// Baud rate and character format.
    #[serde(deserialize_with = "compact_line")]
    pub line: Line,
    /// Modbus unit ids that clients reach here, as in `1-16,20`.
    #[serde(deserialize_with = "super::super::parsed")]
    pub units: Units,
    /// How long a slave has for its reply, in ms, from the end of the request.
    pub reply_timeout_ms: u32,
    /// Pause after a broadcast, in ms.
    pub turnaround_ms: u32,
    /// Pause after each transaction before the same slave is addressed again, in ms.
    pub rest_ms: u32,
    /// How long a slave that did not answer is left alone, in ms, lest its late reply meets the next request.
    /// `reply_timeout_ms` where absent.
    pub quarantine_ms: Option<u32>,
    /// How long a request may wait for its turn, in ms.
    pub queue_timeout_ms: u32,
    /// Whether the line gives back what is sent.
    pub echo: Echo,
}

impl Default for Modbus {
    /// The line is as EDB drives are delivered.
    fn default() -> Self {
        let mut units = Units::default();
        (1..=247).for_each(|unit| units.insert(unit));
        Self {
            line: Line { baud: 9600, format: Format { data_bits: 8, parity: Parity::Odd, stop_bits: 1 } },
            units,
            reply_timeout_ms: 500,
            turnaround_ms: 100,
            rest_ms: 0,
            quarantine_ms: None,
            queue_timeout_ms: 3000,
            echo: Echo::Off,
        }
    }
}

impl Modbus {
    pub(in crate::settings) fn check(&self) -> Result<(), Range> {
        if !(5..=60_000).contains(&self.reply_timeout_ms) {
            return Err(("reply_timeout_ms", "5 to 60000 is allowed"));
        }
        if self.turnaround_ms > 10_000 {
            return Err(("turnaround_ms", "0 to 10000 is allowed"));
        }
        if self.rest_ms > 10_000 {
            return Err(("rest_ms", "0 to 10000 is allowed"));
        }
        if self.quarantine_ms.is_some_and(|ms| ms > 60_000) {
            return Err(("quarantine_ms", "0 to 60000 is allowed"));
        }
        if !(50..=60_000).contains(&self.queue_timeout_ms) {
            return Err(("queue_timeout_ms", "50 to 60000 is allowed"));
        }
        Ok(())
    }
}
