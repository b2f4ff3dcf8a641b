//! What a CANopen bus has.

use serde::{Deserialize, Serialize};

use super::super::check::Range;
use crate::port::BIT_RATES;

/// What a CANopen bus has.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Canopen {
    /// Bits per second.
    pub bitrate: u32,
    /// The manager's own node-ID.
    pub node: u8,
    /// Its CiA 309-3 network number.
    pub net: u16,
    /// Time from one SYNC to the next, in µs; 0: there is no SYNC.
    pub sync_us: u32,
    /// What the counter in SYNC counts up to; 0: there is no counter.
    pub sync_overflow: u8,
    /// Time from one heartbeat of the manager to the next, in ms; 0: it has none.
    pub heartbeat_ms: u16,
    /// How long a node has for each answer to an SDO, in ms.
    pub sdo_timeout_ms: u16,
    /// What clients may do that attach to the bus itself.
    pub client_frames: ClientFrames,
}

/// What clients may do that attach to the bus itself, by SLCAN or socketcand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClientFrames {
    /// They see its frames.
    #[default]
    Read,
    /// They send frames, too.
    Write,
}

impl Default for Canopen {
    fn default() -> Self {
        Self {
            bitrate: 1_000_000,
            node: 127,
            net: 1,
            sync_us: 0,
            sync_overflow: 0,
            heartbeat_ms: 1000,
            sdo_timeout_ms: 500,
            client_frames: ClientFrames::Read,
        }
    }
}

impl Canopen {
    pub(in crate::settings) fn check(&self) -> Result<(), Range> {
        if !BIT_RATES.contains(&self.bitrate) {
            return Err((
                "bitrate",
                "10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000 is allowed",
            ));
        }
        if !(1..=127).contains(&self.node) {
            return Err(("node", "1 to 127 is allowed"));
        }
        if !matches!(self.sync_us, 0 | 500..=60_000_000) {
            return Err(("sync_us", "0 or 500 to 60000000 is allowed"));
        }
        if !matches!(self.sync_overflow, 0 | 2..=240) {
            return Err(("sync_overflow", "0 or 2 to 240 is allowed"));
        }
        if !(10..=60_000).contains(&self.sdo_timeout_ms) {
            return Err(("sdo_timeout_ms", "10 to 60000 is allowed"));
        }
        Ok(())
    }
}
