//! The far side of a CAN port: an SLCAN adapter on a wire, with a bus of simulated nodes.

use std::collections::{BTreeMap, VecDeque};

use puente_canopen::lss::{self, Identity, Part};

use puente_canopen::sdo::{Abort, Dictionary, Server};
use puente_canopen::{Address, Frame, Id, NodeId};
use puente_cell::can::bus::Counters;
use puente_cell::live::can::{flags, states};
use puente_line::Instant;
use puente_slcan::{Command, Flags, Lines, Reply};

use super::client;
use super::wire::{Device, Wire};
use super::{Gateway, until};

/// What is on a CAN bus besides the gateway.
pub trait Bus: Send + 'static {
    /// A frame of the gateway.
    fn send(&mut self, now: Instant, frame: &Frame);
    /// The next frame of another.
    fn poll(&mut self, now: Instant) -> Option<Frame>;
    fn poll_at(&self) -> Option<Instant>;
    /// The error counters of the gateway's controller.
    fn counters(&self) -> Counters {
        Counters::default()
    }
    /// What the gateway has sent and is not on the bus yet is forgotten.
    fn discard(&mut self) {}
}

impl Bus for puente_cell::can::Cell {
    fn send(&mut self, now: Instant, frame: &Frame) {
        Self::send(self, now, 0, frame);
    }

    fn poll(&mut self, now: Instant) -> Option<Frame> {
        Self::poll(self, now, 0)
    }

    fn poll_at(&self) -> Option<Instant> {
        Self::poll_at(self)
    }

    fn counters(&self) -> Counters {
        Self::counters(self, 0)
    }

    fn discard(&mut self) {
        Self::discard(self, 0);
    }
}

/// An SLCAN adapter.
pub struct Adapter<B> {
    pub bus: B,
    /// The frames of the gateway so far.
    pub frames: Vec<Frame>,
    /// What its flags say besides.
    pub flags: Flags,
    /// It obeys nothing, as one that has lost its bus.
    pub refuses: bool,
    /// It tells how its controller is without being asked; flags it has anyway.
    pub tells: bool,
    told: Counters,
    lines: Lines,
    open: bool,
    replies: VecDeque<Reply>,
}

impl<B: Bus> Adapter<B> {
    pub fn new(bus: B) -> Self {
        Self {
            bus,
            frames: Vec::new(),
            flags: Flags::default(),
            refuses: false,
            tells: true,
            told: Counters::default(),
            lines: Lines::new(),
            open: false,
            replies: VecDeque::new(),
        }
    }

    /// An adapter on a wire.
    pub fn wire(bus: B) -> Wire<Self> {
        Wire::new(Self::new(bus))
    }
}

impl<B: Bus> Device for Adapter<B> {
    fn receive(&mut self, now: Instant, bytes: &[u8]) {
        for byte in bytes {
            let Some((_, line)) = self.lines.push(*byte) else { continue };
            let command = line.and_then(|line| Command::parse(line).ok());
            self.replies.push_back(match command {
                _ if self.refuses => {
                    self.open = false;
                    Reply::Refused
                }
                Some(Command::Send(frame)) if self.open => {
                    self.frames.push(frame);
                    self.bus.send(now, &frame);
                    Reply::Taken { extended: matches!(frame.id(), Id::Extended(_)) }
                }
                None | Some(Command::Send(_)) => Reply::Refused,
                Some(Command::Flags) => Reply::Flags(Flags(self.flags.0 | flags(self.bus.counters()).0)),
                Some(Command::Version) => Reply::Version { hardware: 1, software: 1 },
                Some(Command::Open | Command::Listen) => {
                    self.open = true;
                    Reply::Done
                }
                Some(Command::Close) => {
                    self.bus.discard();
                    self.open = false;
                    Reply::Done
                }
                Some(_) => Reply::Done,
            });
        }
    }

    fn poll(&mut self, now: Instant) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        while let Some(reply) = self.replies.pop_front() {
            bytes.extend(reply.emit());
        }
        while let Some(frame) = self.bus.poll(now) {
            if self.open {
                bytes.extend(Reply::Heard { frame, stamp: None }.emit());
            }
            if bytes.len() > 512 {
                break;
            }
        }
        let now = self.bus.counters();
        let states = states(std::mem::replace(&mut self.told, now), now);
        if self.open && self.tells {
            bytes.extend(states.iter().flat_map(Reply::emit));
        }
        (!bytes.is_empty()).then_some(bytes)
    }

    fn poll_at(&self) -> Option<Instant> {
        if self.replies.is_empty() { self.bus.poll_at() } else { Some(Instant::ZERO) }
    }

    fn requests(&mut self) -> Vec<(Instant, u8, Vec<u8>)> {
        Vec::new()
    }
}

/// Waits until a gateway has opened the adapter of its network 1.
pub fn await_open(gateway: &Gateway) {
    let mut client = client::Lines::connect(gateway.main);
    // It is answered by nobody.
    until("the adapter is open", || client.ask("[0] 1 lss_switch_glob 0") == "[0] OK");
}

/// Nodes with an object dictionary each, and one without node-ID where there is one.
#[derive(Default)]
pub struct Nodes {
    nodes: Vec<(Server, Objects)>,
    pub slave: Option<Slave>,
    out: VecDeque<Frame>,
}

impl Nodes {
    /// With a node more, which boots at once.
    pub fn with(mut self, id: u8, objects: Objects) -> Self {
        self.nodes.push((Server::new(node(id)), objects));
        self
    }

    /// With a node that is configured over the bus.
    pub fn with_slave(self, slave: Slave) -> Self {
        Self { slave: Some(slave), ..self }
    }

    /// The objects of a node, by its place.
    pub fn objects(&mut self, at: usize) -> &mut Objects {
        &mut self.nodes[at].1
    }

    /// Says something.
    pub fn say(&mut self, id: u16, data: &[u8]) {
        self.out.push_back(Frame::new(Id::base(id), data).expect("8 bytes at most"));
    }
}

impl Bus for Nodes {
    fn send(&mut self, now: Instant, frame: &Frame) {
        for (server, objects) in &mut self.nodes {
            server.receive(now, frame, objects);
        }
        if let (Some(slave), Some(request)) = (&mut self.slave, lss::Request::parse(frame)) {
            self.out.extend(slave.answer(request).map(lss::Response::frame));
        }
    }

    fn poll(&mut self, now: Instant) -> Option<Frame> {
        let answers = self.nodes.iter_mut().find_map(|(server, objects)| server.poll(now, objects));
        self.out.pop_front().or(answers)
    }

    fn poll_at(&self) -> Option<Instant> {
        let said = (!self.out.is_empty()).then_some(Instant::ZERO);
        said.into_iter().chain(self.nodes.iter().filter_map(|(server, _)| server.poll_at())).min()
    }
}

pub fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("a node-ID")
}

/// The objects of a node. Reading or writing one gives its abort code where it has one.
#[derive(Default)]
pub struct Objects {
    values: BTreeMap<Address, Result<Vec<u8>, u32>>,
    at: Option<Address>,
    coming: Vec<u8>,
}

impl Objects {
    pub fn with(mut self, index: u16, sub: u8, value: impl Into<Vec<u8>>) -> Self {
        self.values.insert(Address::new(index, sub), Ok(value.into()));
        self
    }

    pub fn refusing(mut self, index: u16, abort: u32) -> Self {
        self.values.insert(Address::new(index, 0), Err(abort));
        self
    }

    /// A value.
    pub fn value(&self, index: u16, sub: u8) -> Option<&[u8]> {
        self.values.get(&Address::new(index, sub))?.as_deref().ok()
    }

    fn get(&self, address: Address) -> Result<&[u8], Abort> {
        match self.values.get(&address) {
            Some(Ok(value)) => Ok(value),
            Some(Err(abort)) => Err(Abort(*abort)),
            None => Err(Abort::NO_OBJECT),
        }
    }
}

impl Dictionary for Objects {
    fn upload(&mut self, address: Address) -> Result<u32, Abort> {
        let size = self.get(address)?.len() as u32;
        self.at = Some(address);
        Ok(size)
    }

    fn read(&mut self, offset: u32, into: &mut [u8]) {
        let value = self.at.map(|at| self.get(at).expect("what is read")).expect("an object");
        let offset = offset as usize;
        into.copy_from_slice(&value[offset..offset + into.len()]);
    }

    fn download(&mut self, address: Address, _: Option<u32>) -> Result<(), Abort> {
        self.get(address)?;
        (self.at, self.coming) = (Some(address), Vec::new());
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        self.coming.extend_from_slice(bytes);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Abort> {
        let value = std::mem::take(&mut self.coming);
        self.values.insert(self.at.expect("an object"), Ok(value));
        Ok(())
    }

    fn discard(&mut self) {
        self.coming.clear();
    }
}

/// A node that is configured over the bus (CiA 305).
pub struct Slave {
    pub identity: Identity,
    /// 255: none.
    pub id: u8,
    /// What it answers to node-ID, bit rate and store.
    pub error: u8,
    configuration: bool,
    selected: u8,
    /// Which part fastscan asks for.
    part: u8,
}

impl Slave {
    pub fn new(identity: Identity) -> Self {
        Self { identity, id: 255, error: 0, configuration: false, selected: 0, part: 0 }
    }

    fn answer(&mut self, request: lss::Request) -> Option<lss::Response> {
        use lss::{Request, Response};
        let part = |number: u8| Part::from_number(number).map(|part| self.identity.part(part));
        match request {
            Request::SwitchGlobal(mode) => {
                self.configuration = mode == lss::Mode::Configuration;
                None
            }
            Request::Select(part, value) => {
                let next = part as u8 == self.selected && self.identity.part(part) == value;
                self.selected = if next { self.selected + 1 } else { 0 };
                let whole = self.selected == 4;
                if whole {
                    (self.configuration, self.selected) = (true, 0);
                }
                whole.then_some(Response::Selected)
            }
            Request::Fastscan { bit: Request::START, .. } if self.id == 255 => {
                self.part = 0;
                Some(Response::Identified)
            }
            Request::Fastscan { id, bit, part: asked, next } if self.id == 255 && asked == self.part => {
                if (part(asked)? ^ id) >> bit != 0 {
                    return None;
                }
                if bit == 0 {
                    self.configuration = next < asked;
                    self.part = next;
                }
                Some(Response::Identified)
            }
            _ if !self.configuration => None,
            Request::ConfigureNodeId(id) => {
                if self.error == 0 {
                    self.id = id;
                }
                Some(Response::Configured { what: 0x11, error: self.error, vendor: 7 })
            }
            Request::ConfigureBitTiming { .. } => {
                Some(Response::Configured { what: 0x13, error: self.error, vendor: 7 })
            }
            Request::Store => Some(Response::Configured { what: 0x17, error: self.error, vendor: 7 }),
            Request::Inquire(asked) => Some(Response::Part(asked, self.identity.part(asked))),
            Request::InquireNodeId => Some(Response::NodeId(self.id)),
            Request::ActivateBitTiming { .. } | Request::Fastscan { .. } => None,
        }
    }
}
