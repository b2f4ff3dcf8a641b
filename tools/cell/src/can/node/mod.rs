//! A CANopen node.

use std::fmt;
use std::str::FromStr;

use puente_canopen::nmt::{self, Sign, State};
use puente_canopen::{Frame, NodeId};
use puente_line::Instant;

use super::cell::DriveConfig;

/// What a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// Lexium 23A of Schneider Electric.
    Lexium23a,
    /// CMMS-AS of Festo.
    FestoCmms,
    /// No drive: a node with nothing but its communication profile.
    Node,
}

/// A text that is no [`Model`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadModel(String);

impl fmt::Display for BadModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "'{}' is no model; there are lexium23a, festo-cmms and node", self.0)
    }
}

impl std::error::Error for BadModel {}

impl FromStr for Model {
    type Err = BadModel;

    fn from_str(text: &str) -> Result<Self, BadModel> {
        match text {
            "lexium23a" => Ok(Self::Lexium23a),
            "festo-cmms" => Ok(Self::FestoCmms),
            "node" => Ok(Self::Node),
            _ => Err(BadModel(text.to_owned())),
        }
    }
}

/// A node.
pub struct Node {
    id: NodeId,
    model: Model,
    state: State,
}

impl Node {
    /// A node that is switched on at the start of the clock.
    pub(super) fn new(config: &DriveConfig) -> Self {
        Self { id: config.node, model: config.model, state: State::BootUp }
    }

    /// Its node-ID.
    pub fn id(&self) -> NodeId {
        self.id
    }

    /// What it is.
    pub fn model(&self) -> Model {
        self.model
    }

    /// Its NMT state.
    pub fn state(&self) -> State {
        self.state
    }

    pub(super) fn receive(&mut self, _now: Instant, frame: &Frame) {
        let Some((command, node)) = nmt::Command::parse(frame) else { return };
        if node.is_none_or(|node| node == self.id) {
            self.state = match command {
                nmt::Command::ResetNode | nmt::Command::ResetCommunication => State::BootUp,
                command => command.leads_to(),
            };
        }
    }

    pub(super) fn poll(&mut self, _now: Instant) -> Option<Frame> {
        if self.state != State::BootUp {
            return None;
        }
        self.state = State::PreOperational;
        Some(Sign { node: self.id, state: State::BootUp, toggle: false }.frame())
    }

    pub(super) fn poll_at(&self) -> Option<Instant> {
        (self.state == State::BootUp).then_some(Instant::ZERO)
    }
}
