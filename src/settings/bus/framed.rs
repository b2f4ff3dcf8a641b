//! What a framed bus has.

use puente_line::{Format, Parity, Settings as Line};
use serde::{Deserialize, Serialize};

use super::super::check::Range;
use super::{Echo, compact_line};

/// What a framed bus has.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Framed {
    /// Baud rate and character format.
    #[serde(deserialize_with = "compact_line")]
    pub line: Line,
    /// The gateway's own address on the line.
    pub station: u8,
    /// How the back-off grows.
    pub policy: Policy,
    /// Time from one cyclic packet to the next, in ms.
    pub cycle_ms: u16,
    /// Silence before a frame, the inter-packet gap, in characters.
    pub ipg: u16,
    /// Unit of the back-off, in characters.
    pub slot: u16,
    /// Collisions in a row after which a frame is given up.
    pub attempts: u8,
    /// Frames outstanding to one station.
    pub window: u8,
    /// Whether the line gives back what is sent: only then collisions are seen.
    pub echo: Echo,
}

/// How the back-off of a framed bus grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Policy {
    /// Truncated binary exponential.
    Truncated,
    /// As in the thesis.
    Thesis,
}

impl Default for Framed {
    /// The line has the rate of the thesis' tests.
    fn default() -> Self {
        Self {
            line: Line {
                baud: 1_000_000,
                format: Format { data_bits: 8, parity: Parity::None, stop_bits: 1 },
            },
            station: 1,
            policy: Policy::Truncated,
            cycle_ms: 2,
            ipg: 2,
            slot: 8,
            attempts: 16,
            window: 4,
            echo: Echo::Verify,
        }
    }
}

impl Framed {
    pub(in crate::settings) fn check(&self) -> Result<(), Range> {
        if !(1..=254).contains(&self.station) {
            return Err(("station", "1 to 254 is allowed"));
        }
        if !(1..=1000).contains(&self.cycle_ms) {
            return Err(("cycle_ms", "1 to 1000 is allowed"));
        }
        if !(1..=1000).contains(&self.ipg) {
            return Err(("ipg", "1 to 1000 characters are allowed"));
        }
        if !(1..=1000).contains(&self.slot) {
            return Err(("slot", "1 to 1000 characters are allowed"));
        }
        if !(1..=16).contains(&self.attempts) {
            return Err(("attempts", "1 to 16 is allowed"));
        }
        if !(1..=8).contains(&self.window) {
            return Err(("window", "1 to 8 is allowed"));
        }
        if self.echo == Echo::Strip {
            return Err(("echo", "\"verify\" or \"off\" is what a framed bus can have"));
        }
        Ok(())
    }
}
