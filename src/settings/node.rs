//! A node of a CANopen bus.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::check::Range;
use super::{Name, Write};
use crate::port::limits::WRITES;

/// A node of a CANopen bus: one that is no axis, or what there is to say of an axis' node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Node {
    /// The name of its bus.
    pub bus: Name,
    /// Its node-ID.
    pub id: u8,
    /// What people call it.
    #[serde(default)]
    pub name: Option<Name>,
    /// Nobody misses it.
    #[serde(default)]
    pub optional: bool,
    /// Its vendor-ID (1018h:1), where it matters.
    #[serde(default)]
    pub vendor: Option<u32>,
    /// Its product code (1018h:2), where it matters.
    #[serde(default)]
    pub product: Option<u32>,
    /// Its revision (1018h:3), where it matters.
    #[serde(default)]
    pub revision: Option<u32>,
    /// Its serial number (1018h:4), where it matters.
    #[serde(default)]
    pub serial: Option<u32>,
    /// Its device type (1000h), where it matters.
    #[serde(default)]
    pub device_type: Option<u32>,
    /// Time from one heartbeat of it to the next, in ms, which is written to it; 0: it has none. An axis' node has
    /// [`AXIS_HEARTBEAT_MS`] where nothing is said; another one is left as it is then, and not supervised.
    #[serde(default)]
    pub heartbeat_ms: Option<u16>,
    /// Time from one guarding request to the next, in ms, which is written to it; 0: it is not guarded.
    #[serde(default)]
    pub guard_ms: u16,
    /// Guarding requests without an answer after which it is lost.
    #[serde(default = "usual_life_factor")]
    pub life_factor: u8,
    /// It is started when it has booted.
    #[serde(default = "yes")]
    pub start: bool,
    /// What is written to it when it has booted.
    #[serde(default)]
    pub writes: Vec<Write, WRITES>,
}

/// Time from one heartbeat of an axis' node to the next, in ms, where nothing is said.
pub const AXIS_HEARTBEAT_MS: u16 = 200;

fn usual_life_factor() -> u8 {
    3
}

fn yes() -> bool {
    true
}

impl Node {
    /// One of which nothing is said.
    pub fn new(bus: Name, id: u8) -> Self {
        Self {
            bus,
            id,
            name: None,
            optional: false,
            vendor: None,
            product: None,
            revision: None,
            serial: None,
            device_type: None,
            heartbeat_ms: None,
            guard_ms: 0,
            life_factor: usual_life_factor(),
            start: true,
            writes: Vec::new(),
        }
    }

    pub(super) fn check(&self) -> Result<(), Range> {
        if self.guard_ms > 0 && self.heartbeat_ms.is_some_and(|ms| ms > 0) {
            return Err(("guard_ms", "a node has a heartbeat or is guarded, not both"));
        }
        if !(2..=255).contains(&self.life_factor) {
            return Err(("life_factor", "2 to 255 is allowed"));
        }
        Ok(())
    }
}
