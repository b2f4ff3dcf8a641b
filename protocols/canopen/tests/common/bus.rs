//! A manager and nodes on a bus in virtual time: one frame after the other, the lowest identifier first.

use std::collections::BTreeMap;

use puente_canopen::manager::{Action, BusEvent, Config, Event, Manager, Member, Sdo};
use puente_canopen::nmt::{Command, Sign, State};
use puente_canopen::sdo::{Failure, Outcome, Transfer};
use puente_canopen::{Frame, Id, NodeId, cob, lss};
use puente_line::{Duration, Instant};

use super::channel::Random;
use super::server::{Habits, Message, Server};

/// A frame of 8 bytes at 1 Mbit/s.
pub const FRAME: Duration = Duration::from_micros(130);
/// A node's time for an answer.
const LATENCY: Duration = Duration::from_micros(200);
/// A node's time from its reset to its boot-up.
pub const BOOTS: Duration = Duration::from_millis(20);

pub fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("a node-ID")
}

/// By the text of CiA 301, with volatile settings.
pub struct Node {
    pub id: NodeId,
    pub server: Server,
    /// None while it is off, or boots.
    pub state: Option<State>,
    /// It hears and says nothing.
    pub mute: bool,
    /// Its SDO server does not answer any more.
    pub dead: bool,
    boots: Option<Instant>,
    /// Time of its heartbeat, ms.
    heartbeat: u64,
    beats: Option<Instant>,
    toggle: bool,
    defaults: BTreeMap<(u16, u8), Vec<u8>>,
}

impl Node {
    /// It is on, and has booted a while ago.
    pub fn new(id: u8) -> Self {
        let defaults: BTreeMap<(u16, u8), Vec<u8>> = [
            ((0x1000, 0), vec![0x92, 0x01, 0x02, 0]),
            ((0x1018, 1), vec![0x80, 0, 0, 0]),
            ((0x1018, 4), vec![id, 0, 0, 0]),
            ((0x1017, 0), vec![0, 0]),
            ((0x100C, 0), vec![0, 0]),
            ((0x100D, 0), vec![0]),
            ((0x1400, 1), vec![0; 4]),
            ((0x2000, 0), (0..=255).cycle().take(3_000).collect()),
        ]
        .into();
        let mut server = Server::new(Habits::default());
        server.objects = defaults.clone();
        let id = node(id);
        Self {
            id,
            server,
            state: Some(State::PreOperational),
            mute: false,
            dead: false,
            boots: None,
            heartbeat: 0,
            beats: None,
            toggle: false,
            defaults,
        }
    }

    /// It is off.
    pub fn off(id: u8) -> Self {
        Self { state: None, ..Self::new(id) }
    }

    /// Power off and on, or a reset: it boots.
    pub fn reset(&mut self, now: Instant) {
        self.switch_off();
        self.boots = Some(now + BOOTS);
    }

    pub fn switch_off(&mut self) {
        let written = std::mem::take(&mut self.server.written);
        self.server = Server::new(self.server.habits);
        self.server.objects = self.defaults.clone();
        self.server.written = written;
        (self.state, self.beats, self.toggle, self.boots) = (None, None, false, None);
    }

    fn sign(&self, state: State, toggle: bool) -> Frame {
        Sign { node: self.id, state, toggle }.frame()
    }

    fn take(&mut self, now: Instant, frame: &Frame) -> Vec<Frame> {
        let (Some(state), false) = (self.state, self.mute) else {
            return vec![];
        };
        if let Some((command, to)) = Command::parse(frame) {
            if to.is_none_or(|to| to == self.id) {
                match command {
                    Command::ResetNode | Command::ResetCommunication => self.reset(now),
                    _ => self.state = Some(command.leads_to()),
                }
            }
        } else if *frame == Sign::request(self.id) {
            self.toggle = !self.toggle;
            return vec![self.sign(state, !self.toggle)];
        } else if frame.id() == Id::Base(self.id.sdo_request()) && !self.dead && state != State::Stopped {
            let answers = self.server.take(frame.data().try_into().expect("8 bytes"));
            let [low, high] = self.server.objects[&(0x1017, 0)][..] else {
                panic!("two bytes");
            };
            let heartbeat = u64::from(u16::from_le_bytes([low, high]));
            if heartbeat != self.heartbeat || self.beats.is_none() {
                self.heartbeat = heartbeat;
                self.beats = (heartbeat > 0).then_some(now + Duration::from_millis(heartbeat));
            }
            let id = Id::Base(self.id.sdo_response());
            return answers.into_iter().map(|message: Message| Frame::full(id, message)).collect();
        }
        vec![]
    }

    /// What it says by itself.
    fn poll(&mut self, now: Instant) -> Option<Frame> {
        if self.boots.is_some_and(|at| at <= now) {
            self.boots = None;
            self.state = Some(State::PreOperational);
            return (!self.mute).then(|| self.sign(State::BootUp, false));
        }
        let at = self.beats.filter(|at| *at <= now)?;
        self.beats = Some(at + Duration::from_millis(self.heartbeat));
        let state = self.state.filter(|_| !self.mute)?;
        Some(self.sign(state, false))
    }

    fn poll_at(&self) -> Option<Instant> {
        self.boots.into_iter().chain(self.beats).min()
    }
}

/// What the manager has told, and when.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    Node(u8, Event),
    Bus(BusEvent),
    Lss(Result<lss::Outcome, lss::Failure>),
}

pub struct Bus<'a, const NODES: usize, const CHANNELS: usize> {
    pub now: Instant,
    pub manager: Manager<'a, NODES, CHANNELS>,
    pub nodes: Vec<Node>,
    /// What the manager has sent.
    pub sent: Vec<(Instant, Frame)>,
    pub told: Vec<(Instant, Told)>,
    /// Bytes to be written, by node.
    pub writes: BTreeMap<u8, Vec<u8>>,
    /// Bytes that were read and not taken away.
    pub read: BTreeMap<u8, Vec<u8>>,
    pub done: Vec<(u8, Result<Outcome, Failure>)>,
    /// Room for bytes that are read, by node; else it is endless.
    pub rooms: BTreeMap<u8, usize>,
    /// Frames that get lost, in a thousand, from now on.
    pub loses: u64,
    random: Random,
    /// What the manager's port has taken.
    port: Vec<Frame>,
    /// What nodes want to say, and from when on.
    ready: Vec<(Instant, Frame)>,
    /// What is on the bus, until when, and whether it is the manager's.
    wire: Option<(Instant, Frame, bool)>,
}

/// Frames that the manager's port takes; it has another place for SYNC alone.
const SHARED: usize = 2;

impl<'a, const NODES: usize, const CHANNELS: usize> Bus<'a, NODES, CHANNELS> {
    pub fn new(config: Config, members: &[Member<'a>], nodes: Vec<Node>) -> Self {
        let now = Instant::from_millis(1_000);
        Self {
            now,
            manager: Manager::new(config, members.iter().copied(), now),
            nodes,
            sent: Vec::new(),
            told: Vec::new(),
            writes: BTreeMap::new(),
            read: BTreeMap::new(),
            done: Vec::new(),
            rooms: BTreeMap::new(),
            loses: 0,
            random: Random(9),
            port: Vec::new(),
            ready: Vec::new(),
            wire: None,
        }
    }

    pub fn started(config: Config, members: &[Member<'a>], nodes: Vec<Node>) -> Self {
        let mut bus = Self::new(config, members, nodes);
        bus.manager.start(bus.now);
        bus
    }

    pub fn node(&mut self, id: u8) -> &mut Node {
        self.nodes.iter_mut().find(|node| node.id.value() == id).expect("a node")
    }

    /// Somebody says this.
    pub fn say(&mut self, frame: Frame) {
        self.ready.push((self.now, frame));
    }

    pub fn submit(&mut self, id: u8, transfer: Transfer) {
        self.manager.submit(self.now, node(id), transfer).expect("not busy");
    }

    pub fn reset(&mut self, id: u8) {
        let now = self.now;
        self.node(id).reset(now);
    }

    /// So many milliseconds pass.
    pub fn run(&mut self, millis: u64) {
        self.run_micros(1_000 * millis);
    }

    pub fn run_micros(&mut self, micros: u64) {
        let until = self.now + Duration::from_micros(micros);
        for _ in 0..2_000_000 {
            self.settle();
            let nodes = self.nodes.iter().filter_map(Node::poll_at);
            let wire = match self.wire {
                Some((end, ..)) => Some(end),
                None => self.ready.iter().map(|(at, _)| *at).min(),
            };
            // A full port is asked again when it has sent something.
            let manager = self.manager.poll_at().map(|at| if self.port.len() < SHARED { at } else { until });
            match nodes.chain(wire).chain(manager).min().filter(|next| *next <= until) {
                Some(next) if next > self.now => self.now = next,
                Some(_) if self.now < until => panic!("polling would spin"),
                _ => {
                    self.now = until;
                    return;
                }
            }
        }
        panic!("it spins");
    }

    /// All that happens now.
    fn settle(&mut self) {
        let now = self.now;
        let frames: Vec<_> = self.nodes.iter_mut().filter_map(|node| node.poll(now)).collect();
        frames.into_iter().for_each(|frame| self.say(frame));
        if let Some((_, frame, own)) = self.wire.take_if(|(end, ..)| *end <= now)
            && !self.random.chance(self.loses)
        {
            match own {
                true => {
                    let answers = self.nodes.iter_mut().flat_map(|node| node.take(now, &frame));
                    self.ready.extend(answers.map(|answer| (now + LATENCY, answer)));
                }
                false => self.manager.receive(now, &frame),
            }
        }
        self.poll();
        if self.wire.is_none() {
            self.arbitrate();
            self.poll();
        }
    }

    fn arbitrate(&mut self) {
        // The port is a queue, but for the place of SYNC.
        let sync = self.port.iter().position(|frame| frame.id() == Id::Base(cob::SYNC)).unwrap_or(0);
        let own = self.port.get(sync).map(|frame| (frame.id().raw(), true, sync)).into_iter();
        let ready = self.ready.iter().enumerate().filter(|(_, (at, _))| *at <= self.now);
        let others = ready.map(|(at, (_, frame))| (frame.id().raw(), false, at));
        let Some((_, own, at)) = own.chain(others).min_by_key(|(id, _, at)| (*id, *at)) else {
            return;
        };
        let frame = if own { self.port.remove(at) } else { self.ready.remove(at).1 };
        self.wire = Some((self.now + FRAME, frame, own));
    }

    fn poll(&mut self) {
        for _ in 0..10_000 {
            let action = match self.port.len() {
                0..SHARED => self.manager.poll(self.now),
                SHARED => match self.manager.sync(self.now) {
                    Some(frame) => Action::Transmit(frame),
                    None => self.manager.report(self.now).unwrap_or(Action::Idle),
                },
                _ => self.manager.report(self.now).unwrap_or(Action::Idle),
            };
            match action {
                Action::Transmit(frame) => {
                    self.sent.push((self.now, frame));
                    self.port.push(frame);
                }
                Action::Sdo(of, sdo) => self.sdo(of, sdo),
                Action::Node(of, event) => self.told.push((self.now, Told::Node(of.value(), event))),
                Action::Bus(event) => self.told.push((self.now, Told::Bus(event))),
                Action::Lss(end) => self.told.push((self.now, Told::Lss(end))),
                Action::Idle => return,
            }
        }
        panic!("it does not end");
    }

    fn sdo(&mut self, of: NodeId, sdo: Sdo) {
        let id = of.value();
        match sdo {
            Sdo::Fetch { offset, count } => {
                let bytes = &self.writes[&id][offset as usize..][..count];
                self.manager.supply(self.now, of, bytes);
            }
            Sdo::Data(part) => {
                let read = self.read.entry(id).or_default();
                read.extend_from_slice(&part);
                if let Some(room) = self.rooms.get(&id) {
                    assert!(read.len() <= *room, "more than there is room for");
                    self.manager.pause(of, room - read.len() < 128 * 7);
                }
            }
            Sdo::Done(end) => self.done.push((id, end)),
        }
    }

    /// The caller takes away what was read.
    pub fn drain(&mut self, id: u8) -> Vec<u8> {
        let read = self.read.remove(&id).unwrap_or_default();
        self.manager.pause(node(id), false);
        read
    }

    /// What was told of a node, and not taken yet.
    pub fn events(&mut self, id: u8) -> Vec<Event> {
        let events = self.told.iter().filter_map(|(_, told)| match told {
            Told::Node(of, event) if *of == id => Some(*event),
            _ => None,
        });
        let events = events.collect();
        self.told.retain(|(_, told)| !matches!(told, Told::Node(of, _) if *of == id));
        events
    }

    /// What was told of the bus, and not taken yet.
    pub fn bus_events(&mut self) -> Vec<BusEvent> {
        let events = self.told.iter().filter_map(|(_, told)| match told {
            Told::Bus(event) => Some(*event),
            _ => None,
        });
        let events = events.collect();
        self.told.retain(|(_, told)| !matches!(told, Told::Bus(_)));
        events
    }

    /// NMT commands that were sent since, and to whom.
    pub fn commands(&self, since: Instant) -> Vec<(Command, Option<NodeId>)> {
        let sent = self.sent.iter().filter(|(at, _)| *at >= since);
        sent.filter_map(|(_, frame)| Command::parse(frame)).collect()
    }
}
