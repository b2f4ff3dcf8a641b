//! The LSS slave of a node (CiA 305).

use puente_canopen::lss::{Identity, Mode, Part, Request, Response};
use puente_canopen::{Frame, NodeId};

/// Bits of a part of the identity that a fastscan tries.
const BITS: u32 = 32;
/// No node-ID.
const NONE: u8 = 255;

/// What LSS asks of the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Nothing.
    None,
    /// The node-ID is to be kept over power-off.
    Store,
    /// A node without node-ID has got one, and boots.
    Boot,
}

/// The slave's state.
#[derive(Debug)]
pub struct Slave {
    mode: Mode,
    /// Parts of a selection that were right so far.
    selected: usize,
    /// The part that a fastscan is at.
    scanned: usize,
    /// The node-ID that counts from the next boot on.
    pub pending: Option<NodeId>,
}

impl Slave {
    /// A slave whose node has this node-ID, or none.
    pub fn new(id: Option<NodeId>) -> Self {
        Self { mode: Mode::Waiting, selected: 0, scanned: 0, pending: id }
    }

    /// What it answers to a frame of the master, and what the node is to do. `id` is the node-ID that counts.
    pub fn receive(
        &mut self,
        frame: &Frame,
        identity: &Identity,
        id: Option<NodeId>,
    ) -> (Option<Response>, Effect) {
        let Some(request) = Request::parse(frame) else { return (None, Effect::None) };
        match request {
            Request::SwitchGlobal(mode) => return (None, self.switch(mode, id)),
            Request::Select(part, value) => return (self.select(part, value, identity), Effect::None),
            Request::Fastscan { id: value, bit, part, next } => {
                return (self.scan(identity, id, value, bit, part, next), Effect::None);
            }
            _ if self.mode == Mode::Waiting => return (None, Effect::None),
            _ => {}
        }
        let done = |what, error| Some(Response::Configured { what, error, vendor: 0 });
        match request {
            Request::ConfigureNodeId(new) => {
                let valid = new == NONE || NodeId::new(new).is_some();
                if valid {
                    self.pending = NodeId::new(new);
                }
                (done(0x11, u8::from(!valid)), Effect::None)
            }
            // The bit rate of the simulated bus stays as it is.
            Request::ConfigureBitTiming { .. } => (done(0x13, 1), Effect::None),
            Request::Store => (done(0x17, 0), Effect::Store),
            Request::Inquire(part) => (Some(Response::Part(part, identity.part(part))), Effect::None),
            Request::InquireNodeId => {
                let id = self.pending.or(id).map_or(NONE, NodeId::value);
                (Some(Response::NodeId(id)), Effect::None)
            }
            _ => (None, Effect::None),
        }
    }

    fn switch(&mut self, mode: Mode, id: Option<NodeId>) -> Effect {
        let boots = self.mode == Mode::Configuration && mode == Mode::Waiting;
        self.mode = mode;
        self.selected = 0;
        if boots && id.is_none() && self.pending.is_some() { Effect::Boot } else { Effect::None }
    }

    fn select(&mut self, part: Part, value: u32, identity: &Identity) -> Option<Response> {
        let right = part as usize == self.selected && identity.part(part) == value;
        self.selected = if right { self.selected + 1 } else { 0 };
        if self.selected < Part::ALL.len() {
            return None;
        }
        self.selected = 0;
        self.mode = Mode::Configuration;
        Some(Response::Selected)
    }

    /// Only nodes without a node-ID, in waiting, take part.
    fn scan(
        &mut self,
        identity: &Identity,
        id: Option<NodeId>,
        value: u32,
        bit: u8,
        part: u8,
        next: u8,
    ) -> Option<Response> {
        if id.is_some() || self.pending.is_some() || self.mode == Mode::Configuration {
            return None;
        }
        if bit == Request::START {
            self.scanned = 0;
            return Some(Response::Identified);
        }
        let own = identity.part(Part::from_number(part).filter(|_| usize::from(part) == self.scanned)?);
        let mask = u32::MAX.checked_shl(u32::from(bit)).filter(|_| u32::from(bit) < BITS)?;
        if (own ^ value) & mask != 0 {
            return None;
        }
        if bit == 0 {
            // All of the part is known; after the last one it is selected.
            let last = usize::from(part) + 1 == Part::ALL.len();
            self.scanned = usize::from(next);
            if last && next == 0 {
                self.mode = Mode::Configuration;
            }
        }
        Some(Response::Identified)
    }
}
