//! The nodes on their bus.

use std::collections::VecDeque;

use puente_canopen::{Address, Frame, NodeId};
use puente_line::Instant;

use super::bus::{Bus, Counters, Event, Heard, Order, Totals};
use super::drive::AxisConfig;
use super::fault::Fault;
use super::node::{Model, Node};

/// Events that are kept; the oldest go first.
const LOG: usize = 4_096;

/// So often nodes may ask to be polled at the same time while nothing happens on the bus.
const IDLE_POLLS: u32 = 10_000;

/// A simulated node.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveConfig {
    /// Its node-ID; `None`: it has none yet, and waits for LSS.
    pub node: Option<NodeId>,
    /// What it is.
    pub model: Model,
    /// Its serial number (1018h:4).
    pub serial: u32,
    /// What it moves, if it is a drive.
    pub axis: AxisConfig,
    /// Objects of any length that it has besides, with what is in them.
    pub domains: Vec<(Address, Vec<u8>)>,
}

impl DriveConfig {
    /// A node as delivered; `None` for a node-ID outside of 1 to 127.
    pub fn new(node: u8, model: Model) -> Option<Self> {
        let id = NodeId::new(node)?;
        Some(Self { node: Some(id), ..Self::unconfigured(model, 1_000 + u32::from(node)) })
    }

    /// A node without a node-ID, with a serial number.
    pub fn unconfigured(model: Model, serial: u32) -> Self {
        Self { node: None, model, serial, axis: AxisConfig::default(), domains: Vec::new() }
    }
}

/// A bus to be simulated.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// bit/s.
    pub bitrate: u32,
    /// The nodes.
    pub drives: Vec<DriveConfig>,
    /// Stations outside: seats 0 and on.
    pub ports: usize,
    /// In which order their controllers send what they have.
    pub order: Order,
    /// Probability that a frame is heard by nobody, though it is acknowledged.
    pub drop: f64,
    /// Probability that a frame is destroyed and sent again.
    pub errors: f64,
    /// Seed of all that is random.
    pub seed: u64,
}

impl Config {
    /// One station outside, no nodes, nothing goes wrong.
    pub fn new(bitrate: u32) -> Self {
        Self { bitrate, drives: Vec::new(), ports: 1, order: Order::Given, drop: 0.0, errors: 0.0, seed: 1 }
    }

    /// With a node more.
    pub fn with(mut self, drive: DriveConfig) -> Self {
        self.drives.push(drive);
        self
    }
}

/// A CAN bus with nodes.
///
/// Time never goes back: a `now` earlier than the latest one counts as the latest one.
pub struct Cell {
    bus: Bus,
    ports: usize,
    /// With their seats, which come after those of the ports.
    nodes: Vec<Node>,
    log: VecDeque<Event>,
    now: Instant,
    errors: f64,
}

impl Cell {
    /// A cell right after power-up, at the start of the clock.
    pub fn new(config: Config) -> Self {
        let mut bus = Bus::new(config.bitrate, config.seed);
        bus.set_drop(config.drop);
        bus.set_errors(config.errors);
        for _ in 0..config.ports {
            bus.join(config.order);
        }
        for _ in &config.drives {
            bus.join(Order::Identifier);
        }
        let nodes = config.drives.iter().map(Node::new).collect();
        Self {
            bus,
            ports: config.ports,
            nodes,
            log: VecDeque::new(),
            now: Instant::ZERO,
            errors: config.errors,
        }
    }

    /// The station at a port wants to send a frame, after those that it already wants to.
    pub fn send(&mut self, now: Instant, port: usize, frame: &Frame) {
        self.run(now);
        if port < self.ports {
            self.bus.send(self.now, port, *frame);
        }
        self.run(now);
    }

    /// The next frame that the station at a port has heard.
    pub fn poll(&mut self, now: Instant, port: usize) -> Option<Frame> {
        self.hear(now, port).map(|heard| heard.frame)
    }

    /// As [`Cell::poll`], with the moment.
    pub fn hear(&mut self, now: Instant, port: usize) -> Option<Heard> {
        self.run(now);
        if port < self.ports { self.bus.take(port) } else { None }
    }

    /// When something happens next.
    pub fn poll_at(&self) -> Option<Instant> {
        [self.nodes_at(), self.bus.poll_at()].into_iter().flatten().min()
    }

    /// When a node has something to do. One whose controller has frames is not asked for more of a long answer.
    fn nodes_at(&self) -> Option<Instant> {
        let nodes = (self.ports..).zip(&self.nodes);
        nodes.filter_map(|(seat, node)| node.poll_at(self.bus.pending(seat) == 0)).min()
    }

    /// Drops what the station at a port has sent and is not on the bus yet.
    pub fn discard(&mut self, port: usize) {
        if port < self.ports {
            self.bus.discard(port);
        }
    }

    /// Frames of the station at a port that are not through yet.
    pub fn pending(&self, port: usize) -> usize {
        self.bus.pending(port)
    }

    /// The error counters of the station at a port.
    pub fn counters(&self, port: usize) -> Counters {
        self.bus.counters(port)
    }

    /// The bus, to see what has been on it, and to let something go wrong.
    pub fn bus(&mut self) -> &mut Bus {
        &mut self.bus
    }

    /// What has been on the bus.
    pub fn totals(&self) -> Totals {
        self.bus.totals()
    }

    /// The first node with a node-ID.
    pub fn node(&self, id: u8) -> Option<&Node> {
        self.nodes.iter().find(|node| node.id().map(NodeId::value) == Some(id))
    }

    /// All nodes, in the order in which they were given.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Lets something go wrong from now on with the first node with a node-ID, or mends it; false where there is none. What
    /// is of the bus itself is of node 0.
    pub fn suffer(&mut self, now: Instant, id: u8, fault: Fault) -> bool {
        self.run(now);
        if let Fault::Short(short) = fault {
            self.bus.set_errors(if short { 1.0 } else { self.errors });
            return id == 0;
        }
        let found = self.nodes.iter().position(|node| node.id().map(NodeId::value) == Some(id));
        let Some(at) = found else { return false };
        let seat = self.ports + at;
        match fault {
            Fault::Die => self.bus.set_present(seat, false),
            // Off and on: what it still had to send is gone. Two of one node-ID would collide with it for ever.
            Fault::Reset | Fault::Id(_) => {
                self.bus.set_present(seat, false);
                self.bus.set_present(seat, true);
            }
            Fault::BusOff => self.bus.switch_off(seat),
            Fault::Babble(frame, time) => self.bus.babble(seat, frame, self.now + time),
            _ => {}
        }
        self.nodes[at].suffer(self.now, fault);
        self.run(now);
        true
    }

    /// The last events on the bus, oldest first, which are forgotten then.
    pub fn take_events(&mut self) -> impl Iterator<Item = Event> + use<> {
        std::mem::take(&mut self.log).into_iter()
    }

    /// Lets everything happen that is due by `now`, each at its own moment.
    pub fn run(&mut self, now: Instant) {
        let now = self.now.max(now);
        let mut idle = 0;
        loop {
            // Nodes first: who wants to send at a moment takes part in the arbitration of that moment.
            let node = self.nodes_at().filter(|at| *at <= now);
            let bus = self.bus.poll_at().filter(|at| *at <= now);
            match (node, bus) {
                (Some(at), bus) if bus.is_none_or(|bus| at <= bus) => {
                    idle = if at > self.now { 0 } else { idle + 1 };
                    assert!(idle < IDLE_POLLS, "a node asks to be polled again and again at {at:?}");
                    self.poll_nodes(self.now.max(at));
                }
                (_, Some(at)) => {
                    idle = 0;
                    self.step(self.now.max(at));
                }
                _ => break,
            }
        }
        self.step(now);
    }

    fn poll_nodes(&mut self, now: Instant) {
        self.now = now;
        for (seat, node) in (self.ports..).zip(&mut self.nodes) {
            while let Some(frame) = node.poll(now, self.bus.pending(seat) == 0) {
                self.bus.send(now, seat, frame);
            }
        }
    }

    fn step(&mut self, now: Instant) {
        self.now = now;
        while let Some(event) = self.bus.step(now) {
            if self.log.len() == LOG {
                self.log.pop_front();
            }
            self.log.push_back(event);
            for (seat, node) in (self.ports..).zip(&mut self.nodes) {
                while let Some(heard) = self.bus.take(seat) {
                    node.receive(heard.at, &heard.frame);
                }
            }
            self.poll_nodes(now);
        }
    }
}
