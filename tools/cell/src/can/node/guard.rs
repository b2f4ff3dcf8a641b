//! Heartbeat, node guarding and life guarding of a node (7.2.8.2.2, 7.2.8.3.2).

use std::time::Duration;

use puente_canopen::nmt::{Sign, State};
use puente_canopen::{Address, Frame, Id, NodeId, object};
use puente_line::Instant;

use super::Objects;
use super::communication::CONSUMERS;

/// Who is watched by this node, and who watches it.
#[derive(Debug, Default)]
pub struct Guard {
    heartbeat: Option<Instant>,
    /// That of the next answer to guarding.
    toggle: bool,
    /// The toggle bit does not alternate: a fault.
    pub stuck: bool,
    /// The master guards; it is lost then.
    life: Option<Instant>,
    /// Nodes whose heartbeat has been heard, and when they are lost.
    watched: Vec<(u8, Instant)>,
}

impl Guard {
    /// As after a reset of communication.
    pub fn reset(&mut self) {
        *self = Self { stuck: self.stuck, ..Self::default() };
    }

    /// The producer heartbeat time has been written, or the node has booted.
    pub fn start_heartbeat(&mut self, now: Instant, objects: &Objects) {
        let period = objects.get(object::HEARTBEAT_TIME);
        self.heartbeat = (period > 0).then(|| now + Duration::from_millis(period as u64));
    }

    /// The heartbeat that is due.
    pub fn poll(&mut self, now: Instant, objects: &Objects, node: NodeId, state: State) -> Option<Frame> {
        let due = self.heartbeat.filter(|due| *due <= now)?;
        let period = Duration::from_millis(objects.get(object::HEARTBEAT_TIME) as u64);
        self.heartbeat = (!period.is_zero()).then(|| due + period);
        Some(Sign { node, state, toggle: false }.frame())
    }

    /// The answer to a guarding request; none of a node that has a heartbeat.
    pub fn answer(&mut self, now: Instant, objects: &Objects, node: NodeId, state: State) -> Option<Frame> {
        let time = objects.get(object::GUARD_TIME) * objects.get(object::LIFE_TIME_FACTOR);
        self.life = (time > 0).then(|| now + Duration::from_millis(time as u64));
        if self.heartbeat.is_some() {
            return None;
        }
        let toggle = self.toggle;
        self.toggle = !toggle && !self.stuck;
        Some(Sign { node, state, toggle }.frame())
    }

    /// A frame of another node: its heartbeat may be watched.
    pub fn hear(&mut self, now: Instant, objects: &Objects, frame: &Frame) {
        let Some(Sign { node, .. }) = Sign::parse(frame) else { return };
        let Some(time) = watched(objects).find(|(watched, _)| *watched == node.value()) else { return };
        self.watched.retain(|(watched, _)| *watched != node.value());
        self.watched.push((node.value(), now + time.1));
    }

    /// Whether somebody who was there is lost since the last call.
    pub fn lost(&mut self, now: Instant, objects: &Objects) -> bool {
        let life = self.life.take_if(|life| *life <= now).is_some();
        let before = self.watched.len();
        self.watched.retain(|(_, until)| *until > now);
        let watched = |node: u8| watched(objects).any(|(watched, _)| watched == node);
        let lost = self.watched.len() < before;
        self.watched.retain(|(node, _)| watched(*node));
        life || lost
    }

    /// When something is due.
    pub fn poll_at(&self) -> Option<Instant> {
        let watched = self.watched.iter().map(|(_, until)| *until);
        watched.chain(self.heartbeat).chain(self.life).min()
    }
}

/// Whose heartbeat is to be watched, and for how long it may be missing (1016h).
fn watched(objects: &Objects) -> impl Iterator<Item = (u8, Duration)> {
    (1..=CONSUMERS).filter_map(|sub| {
        let entry = objects.get(Address::new(0x1016, sub)) as u32;
        let (node, time) = ((entry >> 16) as u8, entry & 0xFFFF);
        (node > 0 && time > 0).then(|| (node, Duration::from_millis(time.into())))
    })
}

/// Whether a frame asks this node for its state.
pub fn asks(frame: &Frame, node: NodeId) -> bool {
    frame.is_remote() && frame.id() == Id::Base(node.error_control())
}
