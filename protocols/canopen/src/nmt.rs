//! Network management: what the NMT master commands, and the states of a node (7.2.8, 7.3.2).

use core::fmt;

use crate::cob::{self, NodeId};
use crate::frame::{Frame, Id};

/// State of a node, as it says itself in error control messages (7.2.8.3.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It has just booted: 0. Never said in answer to guarding.
    BootUp,
    /// Stopped: 4. Nothing but NMT and error control works.
    Stopped,
    /// Operational: 5. Everything works.
    Operational,
    /// Pre-operational: 127. Everything but PDOs works.
    PreOperational,
}

impl State {
    /// Its code, 7 bits.
    pub const fn code(self) -> u8 {
        match self {
            Self::BootUp => 0,
            Self::Stopped => 4,
            Self::Operational => 5,
            Self::PreOperational => 0x7F,
        }
    }

    /// The state of a code; `None` for those that the standard reserves.
    pub const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            0 => Self::BootUp,
            4 => Self::Stopped,
            5 => Self::Operational,
            0x7F => Self::PreOperational,
            _ => return None,
        })
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BootUp => "boot-up",
            Self::Stopped => "stopped",
            Self::Operational => "operational",
            Self::PreOperational => "pre-operational",
        })
    }
}

/// What the NMT master commands (7.2.8.3.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Command {
    /// Start: go to operational.
    Start = 0x01,
    /// Stop: go to stopped.
    Stop = 0x02,
    /// Enter pre-operational.
    EnterPreOperational = 0x80,
    /// Reset node: as after power-on.
    ResetNode = 0x81,
    /// Reset communication: the communication objects as after power-on.
    ResetCommunication = 0x82,
}

impl Command {
    /// The command of a code; `None` for those that the standard reserves.
    pub const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            0x01 => Self::Start,
            0x02 => Self::Stop,
            0x80 => Self::EnterPreOperational,
            0x81 => Self::ResetNode,
            0x82 => Self::ResetCommunication,
            _ => return None,
        })
    }

    /// The state that follows in a node which is not initialising (7.3.2.4). After a reset it says boot-up before.
    pub const fn leads_to(self) -> State {
        match self {
            Self::Start => State::Operational,
            Self::Stop => State::Stopped,
            Self::EnterPreOperational | Self::ResetNode | Self::ResetCommunication => State::PreOperational,
        }
    }

    /// The frame that tells it to one node, or with `None` to all.
    pub fn frame(self, node: Option<NodeId>) -> Frame {
        Frame::of(Id::Base(cob::NMT), [self as u8, node.map_or(0, NodeId::value)])
    }

    /// The command in a frame, and to whom; `None` where it is no NMT command.
    pub fn parse(frame: &Frame) -> Option<(Self, Option<NodeId>)> {
        let &[code, node] = frame.data_of(cob::NMT)? else {
            return None;
        };
        let node = match node {
            0 => None,
            node => Some(NodeId::new(node)?),
        };
        Some((Self::from_code(code)?, node))
    }
}

/// What a node says of itself: its boot-up (7.2.8.3.3), its heartbeat or its answer to guarding (7.2.8.3.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sign {
    /// Who.
    pub node: NodeId,
    /// Its state.
    pub state: State,
    /// The toggle bit of guarding; false in heartbeats.
    pub toggle: bool,
}

impl Sign {
    const TOGGLE: u8 = 0x80;

    /// Its frame.
    pub fn frame(self) -> Frame {
        let toggle = if self.toggle { Self::TOGGLE } else { 0 };
        Frame::of(Id::Base(self.node.error_control()), [self.state.code() | toggle])
    }

    /// The sign in a frame; `None` where it is none, or its state is reserved.
    pub fn parse(frame: &Frame) -> Option<Self> {
        let cob::Function::ErrorControl(node) = cob::Function::of(frame.id())? else {
            return None;
        };
        let &[byte] = frame.data() else {
            return None;
        };
        let state = State::from_code(byte & !Self::TOGGLE)?;
        Some(Self { node, state, toggle: byte & Self::TOGGLE != 0 })
    }

    /// The question that a guarded node answers: a remote frame.
    pub const fn request(node: NodeId) -> Frame {
        Frame::remote(Id::Base(node.error_control()), 1)
    }
}
