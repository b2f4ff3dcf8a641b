//! This node's own boot-up and heartbeat (7.2.8.3.2.2, 7.2.8.3.3).

use core::time::Duration;

use puente_line::Instant;

use crate::cob::NodeId;
use crate::cycle::Cycle;
use crate::frame::Frame;
use crate::nmt::{Sign, State};

/// Says that this node is there: its boot-up once, its heartbeat every so often from then on.
#[derive(Clone, Debug)]
pub struct Producer {
    node: NodeId,
    state: State,
    booted: bool,
    cycle: Cycle,
}

impl Producer {
    /// One that boots with the first poll and is pre-operational from then on. A period of zero means no heartbeat.
    pub const fn new(node: NodeId, period: Duration) -> Self {
        Self { node, state: State::PreOperational, booted: false, cycle: Cycle::new(period) }
    }

    /// The state that its heartbeats say.
    pub const fn set_state(&mut self, state: State) {
        self.state = state;
    }

    /// What is due.
    pub fn poll(&mut self, now: Instant) -> Option<Frame> {
        if !self.booted {
            self.booted = true;
            self.cycle.start(now + self.cycle.period());
            return Some(Sign { node: self.node, state: State::BootUp, toggle: false }.frame());
        }
        self.cycle.take(now)?;
        Some(Sign { node: self.node, state: self.state, toggle: false }.frame())
    }

    /// When something is due.
    pub const fn poll_at(&self) -> Option<Instant> {
        if self.booted { self.cycle.due() } else { Some(Instant::ZERO) }
    }
}
