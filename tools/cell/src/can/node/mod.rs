//! A CANopen node, from its own point of view: what is common to drives and others.

mod communication;
pub mod emcy;
mod guard;
mod lss;
mod model;
pub mod objects;
mod pdo;
mod server;
mod write;

use std::collections::VecDeque;

pub use emcy::Errors;
use guard::Guard;
use lss::{Effect, Slave};
pub use model::{BadModel, Model};
pub use objects::Objects;
use pdo::{Pdos, Received};
use puente_canopen::lss::Identity;
use puente_canopen::nmt::{self, Sign, State};
use puente_canopen::{Address, Frame, NodeId, object, sync};
use puente_line::Instant;
use server::Server;

use super::cell::DriveConfig;
use super::drive::Drive;
use super::fault::Fault;

/// Errors of communication: code, bit of the register.
const LENGTH_SHORT: u16 = 0x8210;
const LENGTH_LONG: u16 = 0x8220;
const SYNC_LENGTH: u16 = 0x8240;
/// The master, or a node whose heartbeat is watched, is lost.
pub(super) const GUARDING: u16 = 0x8130;

/// All indexes, and those of the communication profile.
const ALL: std::ops::RangeInclusive<u16> = 0..=u16::MAX;
const COMMUNICATION: std::ops::RangeInclusive<u16> = 0x1000..=0x1FFF;

/// A node.
pub struct Node {
    /// The node-ID that counts; without one it does nothing but LSS.
    id: Option<NodeId>,
    /// That of the next power-on.
    stored_id: Option<NodeId>,
    model: Model,
    identity: Identity,
    state: State,
    objects: Objects,
    errors: Errors,
    pdos: Pdos,
    guard: Guard,
    slave: Slave,
    server: Server,
    drive: Option<Box<Drive>>,
    outbox: VecDeque<Frame>,
    mute: bool,
}

impl Node {
    /// A node that is switched on at the start of the clock.
    pub(super) fn new(config: &DriveConfig) -> Self {
        let id = config.node;
        let identity = config.model.identity(config.serial);
        let mut objects = Objects::default();
        communication::define(&mut objects, config.model, id.unwrap_or(NodeId::MAX), identity);
        for (address, bytes) in &config.domains {
            objects.bytes(address.index, address.sub, objects::Access::Write, bytes);
        }
        let drive = config
            .model
            .profile()
            .map(|profile| Box::new(Drive::new(config.model, profile, config.axis.clone(), &mut objects)));
        let mut node = Self {
            id,
            stored_id: id,
            model: config.model,
            identity,
            state: State::BootUp,
            pdos: Pdos::new(&objects),
            objects,
            errors: Errors::default(),
            guard: Guard::default(),
            slave: Slave::new(id),
            server: Server::new(id),
            drive,
            outbox: VecDeque::new(),
            mute: false,
        };
        node.boot(Instant::ZERO);
        node
    }

    /// Its node-ID; `None` where it has none.
    pub fn id(&self) -> Option<NodeId> {
        self.id
    }

    /// What it is.
    pub fn model(&self) -> Model {
        self.model
    }

    /// Who it is.
    pub fn identity(&self) -> Identity {
        self.identity
    }

    /// Its NMT state.
    pub fn state(&self) -> State {
        self.state
    }

    /// The drive that it is, if it is one.
    pub fn drive(&self) -> Option<&Drive> {
        self.drive.as_deref()
    }

    /// The bytes of one of its objects, as they are now; empty where it does not have it.
    pub fn object(&self, index: u16, sub: u8) -> &[u8] {
        self.objects.read(Address::new(index, sub)).unwrap_or_default()
    }

    /// Something is wrong from now on, or happens once.
    pub(super) fn suffer(&mut self, now: Instant, fault: Fault) {
        match fault {
            Fault::Mute(mute) => self.mute = mute,
            Fault::SdoDead(dead) => self.server.says = if dead { Some(0) } else { None },
            Fault::SdoDies(after) => self.server.says = Some(after),
            Fault::Slow(delay) => self.server.delay = delay,
            Fault::WrongToggle => self.guard.stuck = true,
            Fault::Identity(product) => {
                self.identity.product = product;
                communication::define_identity(&mut self.objects, self.identity);
            }
            Fault::Emergencies(count) => {
                for number in 0..count {
                    self.errors.event(&mut self.objects, 0xFF00, [number, 0, 0, 0, 0]);
                }
            }
            Fault::Reset => self.power_on(now),
            Fault::Id(id) => {
                self.stored_id = Some(id);
                self.power_on(now);
            }
            Fault::Drive(fault) => {
                if let Some(drive) = &mut self.drive {
                    drive.suffer(now, fault, &mut self.objects, &mut self.errors);
                }
            }
            // Of its place on the bus.
            Fault::Die | Fault::BusOff | Fault::Babble(..) | Fault::Short(_) => {}
        }
        self.pdos.look(&self.objects);
    }

    pub(super) fn receive(&mut self, now: Instant, frame: &Frame) {
        self.advance(now);
        let (response, effect) = self.slave.receive(frame, &self.identity, self.id);
        self.outbox.extend(response.map(puente_canopen::lss::Response::frame));
        match effect {
            Effect::None => {}
            Effect::Store => self.stored_id = self.slave.pending,
            Effect::Boot => self.boot(now),
        }
        let Some(id) = self.id else { return };
        if let Some((command, to)) = nmt::Command::parse(frame) {
            if to.is_none_or(|to| to == id) {
                self.command(now, command);
            }
        } else if guard::asks(frame, id) {
            self.outbox.extend(self.guard.answer(now, &self.objects, id, self.state));
        } else if frame.id().raw() == self.objects.get(object::SYNC_COB_ID) as u32 {
            self.sync(now, frame);
        } else if let Some(received) = self.pdos.receive(frame) {
            self.take_pdo(now, received);
        } else if let Some(answer) = self.pdos.answer(frame, &self.objects) {
            self.outbox.push_back(answer);
        } else {
            self.guard.hear(now, &self.objects, frame);
            if self.state != State::Stopped {
                self.with_server(now, |server, objects| server.receive(now, frame, objects));
            }
        }
    }

    /// The next frame to be sent. `idle`: nothing of the node waits for the bus, so that a segment of many may go.
    pub(super) fn poll(&mut self, now: Instant, idle: bool) -> Option<Frame> {
        self.advance(now);
        loop {
            let frame = self.next_frame(now, idle)?;
            if !self.mute {
                return Some(frame);
            }
        }
    }

    fn next_frame(&mut self, now: Instant, idle: bool) -> Option<Frame> {
        if let Some(frame) = self.outbox.pop_front() {
            return Some(frame);
        }
        let id = self.id?;
        if let Some(heartbeat) = self.guard.poll(now, &self.objects, id, self.state) {
            return Some(heartbeat);
        }
        if self.state == State::Stopped {
            return None;
        }
        let emergency = self.errors.poll(now, &self.objects);
        let frame = emergency.or_else(|| self.pdos.poll(now, &self.objects));
        frame.or_else(|| self.with_server(now, |server, objects| server.poll(now, idle, objects)))
    }

    pub(super) fn poll_at(&self, idle: bool) -> Option<Instant> {
        if !self.outbox.is_empty() {
            return Some(Instant::ZERO);
        }
        self.id?;
        let drive = self.drive.as_ref().and_then(|drive| drive.poll_at());
        let always = [self.guard.poll_at(), drive];
        let running = [self.errors.poll_at(), self.pdos.poll_at(), self.server.poll_at(idle)];
        let running = running.into_iter().filter(|_| self.state != State::Stopped);
        always.into_iter().chain(running).flatten().min()
    }

    /// Lets the drive catch up with the time, and sees whether the master is still there.
    pub(super) fn advance(&mut self, now: Instant) {
        if let Some(drive) = &mut self.drive
            && drive.advance(now, &mut self.objects, &mut self.errors)
        {
            self.pdos.look(&self.objects);
        }
        if self.guard.lost(now, &self.objects) {
            self.lose_master(now);
        }
    }

    /// 1029h:1 says what becomes of the state, 6007h what the drive does.
    fn lose_master(&mut self, now: Instant) {
        self.errors.raise(&mut self.objects, GUARDING, emcy::register::COMMUNICATION, [0; 5]);
        match self.objects.get(Address::new(0x1029, 1)) {
            0 if self.state == State::Operational => self.enter(now, State::PreOperational),
            2 => self.enter(now, State::Stopped),
            _ => {}
        }
        if let Some(drive) = &mut self.drive {
            drive.lose_master(now, &mut self.objects, &mut self.errors);
        }
    }

    fn command(&mut self, now: Instant, command: nmt::Command) {
        match command {
            nmt::Command::ResetNode => {
                self.errors.clear_all();
                self.objects.restore(ALL);
                if let Some(drive) = &mut self.drive {
                    drive.restart(now, &mut self.objects, &mut self.errors);
                }
                self.boot(now);
            }
            nmt::Command::ResetCommunication => {
                if let Some(drive) = &mut self.drive {
                    drive.reset_by_master(now, &mut self.objects, &mut self.errors);
                }
                self.boot(now);
            }
            command => self.enter(now, command.leads_to()),
        }
    }

    /// Switched off and on.
    fn power_on(&mut self, now: Instant) {
        self.errors.clear_all();
        self.objects.restore(ALL);
        if let Some(drive) = &mut self.drive {
            drive.power_on(now, &mut self.objects);
        }
        self.slave = Slave::new(self.stored_id);
        self.boot(now);
    }

    /// The communication begins anew, with the node-ID that counts from now on.
    fn boot(&mut self, now: Instant) {
        if self.slave.pending != self.id {
            self.id = self.slave.pending;
            let id = self.id.unwrap_or(NodeId::MAX);
            communication::define(&mut self.objects, self.model, id, self.identity);
        }
        self.objects.restore(COMMUNICATION);
        self.errors.clear(&mut self.objects, GUARDING);
        self.server.reset(self.id);
        self.guard.reset();
        self.guard.start_heartbeat(now, &self.objects);
        self.pdos = Pdos::new(&self.objects);
        self.outbox.clear();
        self.state = State::BootUp;
        if let Some(node) = self.id {
            self.outbox.push_back(Sign { node, state: State::BootUp, toggle: false }.frame());
            self.state = State::PreOperational;
        }
    }

    fn enter(&mut self, now: Instant, state: State) {
        if state == State::Operational && self.state != state {
            self.pdos.start(now);
        } else if state != State::Operational {
            self.pdos.stop();
        }
        self.state = state;
    }

    fn sync(&mut self, now: Instant, frame: &Frame) {
        let id = self.objects.get(object::SYNC_COB_ID) as u16;
        let Some(counter) = sync::parse(id, frame) else {
            let length = [frame.length(), 0, 0, 0, 0];
            return self.errors.event(&mut self.objects, SYNC_LENGTH, length);
        };
        if self.state != State::Operational {
            return;
        }
        let values = self.pdos.sync();
        self.write_all(now, values);
        if let Some(drive) = &mut self.drive {
            drive.sync(&mut self.objects);
        }
        self.outbox.extend(self.pdos.at_sync(counter, &self.objects));
    }

    fn take_pdo(&mut self, now: Instant, received: Received) {
        match received {
            Received::Values { values, long } => {
                if long {
                    self.errors.event(&mut self.objects, LENGTH_LONG, [0; 5]);
                }
                self.write_all(now, values);
            }
            Received::Kept => {}
            Received::Short => self.errors.event(&mut self.objects, LENGTH_SHORT, [0; 5]),
        }
    }

    /// What a PDO brought: all of it is there before the drive looks at any of it.
    fn write_all(&mut self, now: Instant, values: pdo::Values) {
        let Some(drive) = &mut self.drive else { return };
        let mut written = Vec::new();
        for (address, value) in values {
            // What a client may not write now is not taken.
            if drive.check(&self.objects, address, &value).is_ok() {
                self.objects.write(address, &value);
                written.push(address);
            }
        }
        drive.written(now, &written, &mut self.objects, &mut self.errors);
        self.pdos.look(&self.objects);
    }

    /// What a client has written over SDO.
    fn take_written(&mut self, now: Instant, address: Address) {
        match address.index {
            0x1003 => communication::clear_errors(&mut self.objects),
            0x1010 => self.objects.store(),
            0x1011 => self.objects.forget(),
            0x1017 => self.guard.start_heartbeat(now, &self.objects),
            0x1400..=0x1BFF => self.pdos.rebuild(now, &self.objects),
            _ => {}
        }
        if let Some(drive) = &mut self.drive {
            drive.written(now, &[address], &mut self.objects, &mut self.errors);
        }
        self.pdos.look(&self.objects);
    }

    fn with_server<T>(
        &mut self,
        now: Instant,
        act: impl FnOnce(&mut Server, &mut server::Access<'_>) -> T,
    ) -> T {
        let mut access = server::Access::new(&mut self.objects, self.drive.as_deref());
        let result = act(&mut self.server, &mut access);
        for address in access.take_written() {
            self.take_written(now, address);
        }
        result
    }
}
