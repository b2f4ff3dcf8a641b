//! A CANopen manager: everything that one node does to run a bus, put together.
//!
//! SYNC, TIME and its own heartbeat; NMT master; nodes watched by heartbeat or guarding; configured nodes ([`Member`]) judged,
//! configured and started whenever they boot, come back or are tried again; emergencies; SDO transfers with any node; LSS.
//!
//! Frames to be sent are asked for one at a time, so that a full port loses none. Their order: SYNC, NMT commands, the
//! manager's own boot-up, heartbeat and TIME, questions of guarding, LSS, SDO. Members and SDO channels take turns.
//!
//! | fault | what is told | what is done |
//! |---|---|---|
//! | a member is missing | [`Event::Missing`], unless it is optional | tried again every [`Config::retry`] |
//! | no heartbeat, no answer to guarding | [`monitor::Event::Lost`] | tried again; back in the state it was led to it is what it was, else booted anew |
//! | it boots by itself | [`monitor::Event::BootUp`]; its transfer ends with [`Booted`](sdo::Failure::Booted) | booted at once |
//! | it leaves its state by itself | [`monitor::Event::Changed`] | booted anew after [`Config::retry`], when it does so again later and later |
//! | another identity, a refused value, a server that dies at boot | [`Event::NotBooted`] | left alone, tried again later and later, anew when it boots |
//! | a server that dies in a transfer | [`sdo::Failure::Timeout`] | its channel stays with it for the quarantine |
//! | bus off, port gone ([`Manager::bus`]) | [`BusEvent::Off`]; transfers end with [`BusOff`](sdo::Failure::BusOff) | NMT commands that wait are dropped, SYNCs left out and counted; who is not heard is lost in its time |
//! | two nodes of one node-ID | [`Event::DuplicateId`], see [`Evidence`] | nothing |
//! | somebody babbles | [`BusEvent::Babbling`] | what it says is taken note of, not told |
//!
//! None of it costs other nodes anything but the frames on the bus.

mod babble;
mod channel;
mod channels;
mod member;
mod receive;
mod table;
mod transfers;
mod types;
mod work;

use heapless::{Deque, Vec};
use puente_line::Instant;

use crate::emcy::Emergency;
#[cfg(doc)]
use crate::monitor;
use crate::nmt::{Command, State};
use crate::time::{self, TimeOfDay};
use crate::{Frame, NodeId, cob, heartbeat, lss, sdo, sync};
use babble::Babble;
use channels::Channels;
use member::Managed;
pub use table::EMERGENCIES;
use table::Table;
pub use types::{
    Action, BusEvent, Config, Counters, Event, Evidence, Health, Member, Sdo, Status, Unsent, babble_limit,
};

/// NMT commands that may wait.
const COMMANDS: usize = 16;
/// Events that may wait, besides those that each member's monitor keeps.
const EVENTS: usize = 8;

/// A manager of `NODES` members at most, with `CHANNELS` SDO clients that are lent to nodes 1 to 127. Emergencies are kept of
/// the members and of as many other nodes as there is room for.
#[derive(Clone, Debug)]
pub struct Manager<'a, const NODES: usize, const CHANNELS: usize> {
    config: Config,
    running: bool,
    /// The bus is there.
    up: bool,
    sync: sync::Producer,
    heartbeat: heartbeat::Producer,
    time: time::Producer,
    /// When it was how late.
    clock: Option<(Instant, TimeOfDay)>,
    commands: Deque<(Command, Option<NodeId>), COMMANDS>,
    members: Vec<Managed<'a>, NODES>,
    /// Which member is asked first.
    turn: usize,
    channels: Channels<'a, CHANNELS>,
    lss: lss::Master,
    table: Table<NODES>,
    babble: Babble,
    events: Deque<(NodeId, Event), EVENTS>,
    bus_events: Deque<BusEvent, 4>,
    counters: Counters,
}

impl<'a, const NODES: usize, const CHANNELS: usize> Manager<'a, NODES, CHANNELS> {
    /// One that does nothing yet. Of members with the same node-ID the first counts; the manager's own is nobody's.
    pub fn new(config: Config, members: impl IntoIterator<Item = Member<'a>>, now: Instant) -> Self {
        let mut manager = Self::without_members(config);
        manager.join(members, now);
        manager
    }

    /// One without members. It is made where it is to live, as far as the compiler can: it is large, and a stack may not be.
    #[inline(always)]
    pub fn without_members(config: Config) -> Self {
        Self {
            config,
            running: false,
            up: true,
            sync: sync::Producer::new(cob::SYNC, config.sync, config.overflow),
            heartbeat: heartbeat::Producer::new(config.node, config.heartbeat),
            time: time::Producer::new(cob::TIME, config.time),
            clock: None,
            commands: Deque::new(),
            members: Vec::new(),
            turn: 0,
            channels: Channels::new(),
            lss: lss::Master::new(config.lss),
            table: Table::new(),
            babble: Babble::new(config.babble),
            events: Deque::new(),
            bus_events: Deque::new(),
            counters: Counters::default(),
        }
    }

    /// Takes members in, before the start. Of those with the same node-ID the first counts; the manager's own is nobody's.
    pub fn join(&mut self, members: impl IntoIterator<Item = Member<'a>>, now: Instant) {
        for member in members {
            if member.id != self.config.node && self.member(member.id).is_none() {
                let _ = self.members.push(Managed::new(member, now));
                self.table.keep(member.id);
            }
        }
    }

    /// Begins: says its own boot-up, produces what it produces, asks for the members. The first SYNC is due now.
    pub fn start(&mut self, now: Instant) {
        if self.running {
            return;
        }
        self.running = true;
        self.heartbeat.set_state(State::Operational);
        self.sync.start(now);
        self.time.start(now);
        for managed in &mut self.members {
            if managed.member.reset {
                managed.attempt(now + self.config.retry, false);
                let _ = self.commands.push_back((Command::ResetCommunication, Some(managed.member.id)));
            } else {
                managed.attempt(now, false);
            }
        }
    }

    /// It is `time` now, for TIME.
    pub const fn set_time(&mut self, now: Instant, time: TimeOfDay) {
        self.clock = Some((now, time));
    }

    /// Commands this to a node, or with `None` to all.
    ///
    /// # Errors
    /// Any [`Unsent`].
    pub fn command(&mut self, _now: Instant, command: Command, node: Option<NodeId>) -> Result<(), Unsent> {
        if !self.up {
            return Err(Unsent::Off);
        }
        self.commands.push_back((command, node)).map_err(|_| Unsent::Full)
    }

    /// Whether the bus is there; false while its controller is off the bus, or the port is not there.
    pub fn bus(&mut self, now: Instant, up: bool) {
        if up == self.up {
            return;
        }
        self.up = up;
        if self.bus_events.is_full() {
            let _ = self.bus_events.pop_front();
        }
        let _ = self.bus_events.push_back(if up { BusEvent::On } else { BusEvent::Off });
        if up {
            return;
        }
        self.counters.bus_offs = self.counters.bus_offs.wrapping_add(1);
        self.commands.clear();
        self.lss.abandon();
        for channel in self.channels.iter_mut() {
            if channel.boots()
                && let Some(managed) =
                    self.members.iter_mut().find(|managed| Some(managed.member.id) == channel.node())
            {
                managed.interrupted(now);
            }
            channel.lose(now);
        }
    }

    /// What is known of a node.
    pub fn status(&self, node: NodeId) -> Status {
        let managed = self.member(node);
        Status {
            state: match managed {
                Some(managed) => managed.monitor.state(),
                None => self.table.state(node),
            },
            health: managed.map_or(Health::Unmanaged, Managed::health),
            heard: self.table.heard(node),
            emergency: self.table.history(node).and_then(|history| history.pending()),
            duplicate: self.table.is_duplicate(node),
        }
    }

    /// The members, and all nodes that were ever heard.
    pub fn nodes(&self) -> impl Iterator<Item = (NodeId, Status)> {
        NodeId::all().filter_map(|node| Some((node, self.known(node)?)))
    }

    /// What is known of a member, or of a node that was ever heard.
    pub fn known(&self, node: NodeId) -> Option<Status> {
        let known = self.member(node).is_some() || self.table.heard(node).is_some();
        known.then(|| self.status(node))
    }

    /// The last emergencies of a node, the newest last; resets of errors are among them.
    pub fn emergencies(&self, node: NodeId) -> impl Iterator<Item = (Instant, Emergency)> {
        self.table.history(node).into_iter().flat_map(|history| history.entries().copied())
    }

    /// Members that are not optional, and not booted.
    pub fn missing(&self) -> impl Iterator<Item = NodeId> {
        let missing = self.members.iter().filter(|managed| !managed.member.optional && !managed.is_booted());
        missing.map(|managed| managed.member.id)
    }

    /// What has happened.
    pub fn counters(&self) -> Counters {
        let mut sdo = sdo::Counters::default();
        for channel in self.channels.iter() {
            sdo += channel.counters();
        }
        Counters { sdo, sync_missed: self.sync.missed(), ..self.counters }
    }

    /// What to do now. A frame is to be sent, and before all that follow it.
    pub fn poll(&mut self, now: Instant) -> Action {
        if !self.running {
            return Action::Idle;
        }
        self.elapse(now);
        if let Some(frame) = self.sync(now) {
            return Action::Transmit(frame);
        }
        if let Some(action) = self.told(now) {
            return action;
        }
        if self.up { self.transmit(now).unwrap_or(Action::Idle) } else { Action::Idle }
    }

    /// The SYNC that is due, alone: for a caller whose port keeps a place for it. Frames that wait in a port for others of higher
    /// priority would hold it up.
    pub fn sync(&mut self, now: Instant) -> Option<Frame> {
        if self.running && self.up { self.sync.poll(now) } else { None }
    }

    /// What there is besides frames to be sent and bytes that are lacking for them: for a caller whose port takes nothing now.
    /// Not to ask costs blocks that are sent again, and events that are not told.
    pub fn report(&mut self, now: Instant) -> Option<Action> {
        if !self.running {
            return None;
        }
        self.elapse(now);
        self.told(now)
    }

    /// When to poll again, besides after any other call.
    pub fn poll_at(&self) -> Option<Instant> {
        if !self.running {
            return None;
        }
        if !self.events.is_empty() || !self.bus_events.is_empty() {
            return Some(Instant::ZERO);
        }
        let sent = [
            (!self.commands.is_empty()).then_some(Instant::ZERO),
            self.sync.poll_at(),
            self.heartbeat.poll_at(),
            self.time.poll_at(),
        ];
        let channels = self.channels.iter().filter_map(|channel| channel.poll_at());
        let sent = sent.into_iter().flatten().chain(channels).filter(|_| self.up);
        let members = self.members.iter().filter_map(|managed| managed.poll_at(self.up));
        sent.chain(members).chain(self.lss.poll_at()).chain(self.babble.poll_at()).min()
    }

    /// When the next SYNC is due; a poll gives nothing else before it.
    pub const fn sync_at(&self) -> Option<Instant> {
        self.sync.poll_at()
    }

    fn member(&self, node: NodeId) -> Option<&Managed<'a>> {
        self.members.iter().find(|managed| managed.member.id == node)
    }

    fn member_mut(&mut self, node: NodeId) -> Option<&mut Managed<'a>> {
        self.members.iter_mut().find(|managed| managed.member.id == node)
    }
}
