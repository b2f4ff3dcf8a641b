//! What is known of every node that was ever heard, member or not.

use core::time::Duration;

use heapless::Vec;
use puente_line::Instant;

use super::types::Evidence;
use crate::NodeId;
use crate::emcy::{Emergency, History};
use crate::monitor::Event;
use crate::nmt::{Sign, State};

/// Emergencies that are kept of a node.
pub const EMERGENCIES: usize = 4;
/// Changes to and fro that are none of one node, and how soon each follows the one before.
const CHANGES: u8 = 3;
const SOON: Duration = Duration::from_secs(5);

#[derive(Clone, Copy, Debug)]
struct Seen {
    /// Seconds since the start of the clock.
    at: u32,
    /// Seconds, modulo 2^16, when its state changed last without a command.
    changed: u16,
    state: Option<State>,
    /// The highest two bits count such changes.
    flags: u8,
}

impl Seen {
    /// Nothing is known of responses that it may owe.
    const NEVER: Self = Self { at: 0, changed: 0, state: None, flags: OWES };

    /// Its state has changed: whether it has done so too often.
    const fn change(&mut self) -> bool {
        let now = self.at as u16;
        let soon = now.wrapping_sub(self.changed) as u64 <= SOON.as_secs();
        let changes = if soon { self.flags >> 6 } else { 0 };
        let changes = if changes < CHANGES { changes + 1 } else { changes };
        self.flags = self.flags & 0x3F | changes << 6;
        self.changed = now;
        changes == CHANGES
    }

    const fn commanded(&mut self) {
        self.flags &= 0x3F;
    }
}

/// It was heard.
const HEARD: u8 = 1;
/// Somebody else asks its SDO server.
const SHARED: u8 = 2;
/// Its last transfer did not end well: a response may come late.
const OWES: u8 = 4;
/// Two nodes have its node-ID.
const DUPLICATE: u8 = 8;
/// It has answered guarding since it was asked.
const ANSWERED: u8 = 16;
/// Somebody else guards it.
const GUARDED: u8 = 32;

/// `KEPT`: of so many nodes the emergencies are kept.
#[derive(Clone, Debug)]
pub(super) struct Table<const KEPT: usize> {
    nodes: [Seen; 127],
    histories: Vec<(NodeId, History<EMERGENCIES>), KEPT>,
}

impl<const KEPT: usize> Table<KEPT> {
    pub const fn new() -> Self {
        Self { nodes: [Seen::NEVER; 127], histories: Vec::new() }
    }

    /// Its emergencies are kept.
    pub fn keep(&mut self, node: NodeId) {
        if self.history(node).is_none() {
            let _ = self.histories.push((node, History::new()));
        }
    }

    fn seen(&self, node: NodeId) -> Option<&Seen> {
        self.nodes.get(usize::from(node.value()).checked_sub(1)?)
    }

    fn seen_mut(&mut self, node: NodeId) -> Option<&mut Seen> {
        self.nodes.get_mut(usize::from(node.value()).checked_sub(1)?)
    }

    fn has(&self, node: NodeId, flag: u8) -> bool {
        self.seen(node).is_some_and(|seen| seen.flags & flag != 0)
    }

    /// Sets or takes away a flag; whether it was set.
    fn set(&mut self, node: NodeId, flag: u8, to: bool) -> bool {
        let Some(seen) = self.seen_mut(node) else {
            return false;
        };
        let was = seen.flags & flag != 0;
        seen.flags = if to { seen.flags | flag } else { seen.flags & !flag };
        was
    }

    /// Something of the node came.
    pub fn hear(&mut self, now: Instant, node: NodeId) {
        if let Some(seen) = self.seen_mut(node) {
            seen.at = u32::try_from(now.as_micros() / 1_000_000).unwrap_or(u32::MAX);
            seen.flags |= HEARD;
        }
    }

    pub fn heard(&self, node: NodeId) -> Option<Instant> {
        let seen = self.seen(node).filter(|seen| seen.flags & HEARD != 0)?;
        Some(Instant::from_millis(u64::from(seen.at) * 1_000))
    }

    pub fn state(&self, node: NodeId) -> Option<State> {
        self.seen(node)?.state
    }

    pub fn is_duplicate(&self, node: NodeId) -> bool {
        self.has(node, DUPLICATE)
    }

    /// What a sign says that is new, and whether it can be of one node alone.
    pub fn sign(&mut self, now: Instant, sign: Sign) -> (Option<Event>, Option<Evidence>) {
        if sign.state == State::BootUp {
            // An answer to guarding never says so.
            if sign.toggle {
                return (None, None);
            }
            if let Some(seen) = self.seen_mut(sign.node) {
                *seen = Seen { state: None, flags: seen.flags & GUARDED, ..*seen };
            }
            if let Some(history) = self.history_mut(sign.node) {
                history.boot();
            }
            self.hear(now, sign.node);
            return (Some(Event::BootUp), None);
        }
        self.hear(now, sign.node);
        let Some(seen) = self.seen_mut(sign.node) else {
            return (None, None);
        };
        match seen.state.replace(sign.state) {
            None => (Some(Event::Started(sign.state)), None),
            Some(from) if from != sign.state => {
                let evidence = seen.change().then_some(Evidence::State);
                (Some(Event::Changed { from, to: sign.state }), evidence)
            }
            Some(_) => (None, None),
        }
    }

    /// A node, or all of them, got a command: its state may change.
    pub fn commanded(&mut self, node: Option<NodeId>) {
        match node {
            Some(node) => {
                if let Some(seen) = self.seen_mut(node) {
                    seen.commanded();
                }
            }
            None => self.nodes.iter_mut().for_each(Seen::commanded),
        }
    }

    /// The manager asks for a sign.
    pub fn guard(&mut self, node: NodeId) {
        self.set(node, ANSWERED, false);
    }

    /// Somebody else does.
    pub fn guarded(&mut self, node: NodeId) {
        self.set(node, GUARDED, true);
    }

    /// A node that the manager guards has answered: whether it did that twice.
    pub fn answer(&mut self, node: NodeId) -> Option<Evidence> {
        let again = self.set(node, ANSWERED, true);
        (again && !self.has(node, GUARDED)).then_some(Evidence::Guarding)
    }

    /// Somebody else asks the SDO server of a node.
    pub fn share(&mut self, node: NodeId) {
        self.set(node, SHARED, true);
    }

    pub fn is_shared(&self, node: NodeId) -> bool {
        self.has(node, SHARED)
    }

    /// How a transfer ended; whether responses of it may still come.
    pub fn transferred(&mut self, node: NodeId, owes: bool) {
        self.set(node, OWES, owes);
    }

    /// A message of its SDO server came while the manager had asked nothing.
    pub fn unasked(&self, node: NodeId) -> Option<Evidence> {
        (!self.has(node, SHARED | OWES)).then_some(Evidence::Response)
    }

    /// Two nodes have this node-ID.
    pub fn duplicate(&mut self, node: NodeId) {
        self.set(node, DUPLICATE, true);
    }

    pub fn emergency(&mut self, now: Instant, node: NodeId, emergency: Emergency) {
        self.hear(now, node);
        self.keep(node);
        if let Some(history) = self.history_mut(node) {
            history.push(now, emergency);
        }
    }

    pub fn history(&self, node: NodeId) -> Option<&History<EMERGENCIES>> {
        self.histories.iter().find(|(of, _)| *of == node).map(|(_, history)| history)
    }

    fn history_mut(&mut self, node: NodeId) -> Option<&mut History<EMERGENCIES>> {
        self.histories.iter_mut().find(|(of, _)| *of == node).map(|(_, history)| history)
    }
}
