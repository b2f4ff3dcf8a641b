//! A manager with drives.

use core::time::Duration;

use heapless::Vec;
use puente_canopen::manager::{self, BusEvent, Config, Event, Manager, Member, Sdo, Unsent};
use puente_canopen::monitor::Event as Sign;
use puente_canopen::sdo::{Busy, Failure, Transfer};
use puente_canopen::{Frame, NodeId, nmt};
use puente_line::Instant;

use crate::drive::Drive;
use crate::{Action, Axis, Order};

/// So long a caller whose transfer was refused may be the next at a node.
const PATIENCE: Duration = Duration::from_millis(10);

/// Runs a bus with `AXES` drives at most. [`Manager`] has the rest.
#[derive(Clone, Debug)]
pub struct Master<'a, const AXES: usize, const NODES: usize, const CHANNELS: usize> {
    manager: Manager<'a, NODES, CHANNELS>,
    sync: Duration,
    /// The bus is there.
    up: bool,
    places: Vec<Place, AXES>,
    /// The next drive whose set-point goes in this SYNC cycle.
    next: usize,
    counters: Counters,
}

/// A drive, and who uses the SDO channel of its node.
#[derive(Clone, Debug)]
struct Place {
    drive: Drive,
    /// Bytes that its own transfer has read.
    read: Vec<u8, 4>,
    /// More than four came.
    long: bool,
    /// Its own transfer was the last, and a caller was refused: until then the caller is the next.
    yields_until: Option<Instant>,
    /// A caller was refused while its own transfer was in work.
    refused: bool,
}

/// Events since the master was made, each modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Set-points of a SYNC cycle that had not been sent when the next SYNC was due.
    pub late: u32,
    /// Orders taken back.
    pub falls: u32,
}

impl<'a, const AXES: usize, const NODES: usize, const CHANNELS: usize> Master<'a, AXES, NODES, CHANNELS> {
    /// One that wants nothing yet. The nodes of the axes should be among the members, with what [`crate::setup::push`] says in
    /// their plans. Of more than `AXES` axes the rest are left out.
    pub fn new(
        config: Config,
        members: impl IntoIterator<Item = Member<'a>>,
        axes: impl IntoIterator<Item = Axis>,
        now: Instant,
    ) -> Self {
        let mut master = Self::without_members(config);
        master.join(members, axes, now);
        master
    }

    /// One without members and drives: see [`Manager::without_members`].
    #[inline(always)]
    pub fn without_members(config: Config) -> Self {
        Self {
            manager: Manager::without_members(config),
            sync: config.sync,
            up: true,
            places: Vec::new(),
            next: AXES,
            counters: Counters::default(),
        }
    }

    /// Takes members and drives in, before the start.
    pub fn join(
        &mut self,
        members: impl IntoIterator<Item = Member<'a>>,
        axes: impl IntoIterator<Item = Axis>,
        now: Instant,
    ) {
        self.manager.join(members, now);
        let sync = self.sync;
        self.places.extend(axes.into_iter().take(AXES - self.places.len()).map(|axis| Place {
            drive: Drive::new(axis, sync, now),
            read: Vec::new(),
            long: false,
            yields_until: None,
            refused: false,
        }));
    }

    /// See [`Manager::start`].
    pub fn start(&mut self, now: Instant) {
        self.manager.start(now);
    }

    /// The manager, for what does not concern the drives: its table of nodes, emergencies, counters.
    pub const fn manager(&self) -> &Manager<'a, NODES, CHANNELS> {
        &self.manager
    }

    /// The same, to pass on [`Manager::supply`], [`Manager::cancel`], [`Manager::pause`], [`Manager::lss`] and what else is no
    /// transfer, command or frame: those come here.
    pub const fn manager_mut(&mut self) -> &mut Manager<'a, NODES, CHANNELS> {
        &mut self.manager
    }

    /// Says what is wanted of a drive from now on. While current does not count ([`Action::Fell`]), it is not taken.
    pub fn set(&mut self, now: Instant, place: usize, order: Order) {
        if let Some(place) = self.places.get_mut(place) {
            place.drive.set(now, order);
        }
    }

    /// What is wanted of a drive; Observe for one that there is not.
    pub fn order(&self, place: usize) -> Order {
        self.places.get(place).map(|place| place.drive.order()).unwrap_or_default()
    }

    /// See [`Manager::command`].
    ///
    /// # Errors
    /// Any [`Unsent`].
    pub fn command(
        &mut self,
        now: Instant,
        command: nmt::Command,
        node: Option<NodeId>,
    ) -> Result<(), Unsent> {
        self.manager.command(now, command, node)?;
        self.commanded(command, node);
        Ok(())
    }

    /// See [`Manager::bus`].
    pub fn bus(&mut self, now: Instant, up: bool) {
        self.manager.bus(now, up);
        if self.up && !up {
            self.places.iter_mut().for_each(|place| place.drive.cut_off());
        }
        self.up = up;
    }

    /// Takes a transfer of a caller, see [`Manager::submit`]. With the node of a drive callers and the drive take turns.
    ///
    /// # Errors
    /// `Busy`: as there, and while it is the drive's turn.
    pub fn submit(&mut self, now: Instant, node: NodeId, transfer: Transfer) -> Result<(), Busy> {
        self.submit_with(now, node, transfer, None)
    }

    /// As [`Master::submit`], worked as [`Manager::submit_with`] says where there is a `config`.
    ///
    /// # Errors
    /// As [`Master::submit`].
    pub fn submit_with(
        &mut self,
        now: Instant,
        node: NodeId,
        transfer: Transfer,
        config: Option<puente_canopen::sdo::Config>,
    ) -> Result<(), Busy> {
        if let Some(place) = self.places.iter_mut().find(|place| place.drive.axis().node == node)
            && place.refuses(now)
        {
            return Err(Busy);
        }
        match config {
            Some(config) => self.manager.submit_with(now, node, transfer, config),
            None => self.manager.submit(now, node, transfer),
        }
    }

    /// Takes a frame of the bus, see [`Manager::receive`].
    pub fn receive(&mut self, now: Instant, frame: &Frame) {
        self.manager.receive(now, frame);
        if let Some((command, node)) = nmt::Command::parse(frame) {
            self.commanded(command, node);
        }
        for place in &mut self.places {
            place.drive.receive(now, frame);
        }
    }

    /// What to do now. Frames are to be sent in this order: what stops a drive, SYNC, the set-points of its cycle, what else the
    /// drives are told, and what the manager has to say.
    pub fn poll(&mut self, now: Instant) -> Action {
        loop {
            if let Some(frame) = self.stop(now).or_else(|| self.sync(now)) {
                return Action::Transmit(frame);
            }
            if let Some(frame) = self.set_point() {
                return Action::Transmit(frame);
            }
            if let Some(action) = self.told(now) {
                return action;
            }
            if self.up
                && let Some(frame) = self.places.iter_mut().find_map(|place| place.drive.frame(now))
            {
                return Action::Transmit(frame);
            }
            self.begin(now);
            let action = self.manager.poll(now);
            match self.managed(now, action) {
                Some(Action::Idle) if self.places.iter().any(|place| place.drive.is_due()) => {}
                Some(action) => return action,
                None => {}
            }
        }
    }

    /// The SYNC that is due, alone, see [`Manager::sync`]: it may go before frames that were given earlier. Nothing else may.
    pub fn sync(&mut self, now: Instant) -> Option<Frame> {
        let sync = self.manager.sync(now)?;
        let late = self.places.iter().skip(self.next).filter(|place| place.drive.follows()).count();
        self.counters.late = self.counters.late.wrapping_add(late as u32);
        self.next = 0;
        Some(sync)
    }

    /// What stops a drive.
    fn stop(&mut self, now: Instant) -> Option<Frame> {
        for place in &mut self.places {
            place.drive.advance(now);
        }
        if !self.up {
            return None;
        }
        self.places.iter_mut().find_map(|place| place.drive.urgent(now))
    }

    /// What there is besides frames to be sent, see [`Manager::report`].
    pub fn report(&mut self, now: Instant) -> Option<Action> {
        loop {
            for place in &mut self.places {
                place.drive.advance(now);
            }
            if let Some(action) = self.told(now) {
                return Some(action);
            }
            let action = self.manager.report(now)?;
            if let Some(action) = self.managed(now, action) {
                return Some(action);
            }
        }
    }

    /// When to poll again, besides after any other call.
    pub fn poll_at(&self) -> Option<Instant> {
        let sends =
            self.up.then_some(self.next).and_then(|next| self.places.get(next)).map(|_| Instant::ZERO);
        let drives = self.places.iter().filter_map(|place| place.poll_at(self.up));
        drives.chain(sends).chain(self.manager.poll_at()).min()
    }

    /// What has happened.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// An NMT command was given, by whomever.
    fn commanded(&mut self, command: nmt::Command, node: Option<NodeId>) {
        for place in &mut self.places {
            if node.is_none_or(|node| node == place.drive.axis().node) {
                place.drive.network(command.leads_to());
            }
        }
    }

    /// The next set-point of the cycle.
    fn set_point(&mut self) -> Option<Frame> {
        if !self.up || self.sync.is_zero() {
            return None;
        }
        while let Some(place) = self.places.get_mut(self.next) {
            self.next += 1;
            if let Some(frame) = place.drive.cycle() {
                return Some(frame);
            }
        }
        None
    }

    /// What became of the drives.
    fn told(&mut self, _now: Instant) -> Option<Action> {
        for (at, place) in self.places.iter_mut().enumerate() {
            if let Some(why) = place.drive.take_fall() {
                self.counters.falls = self.counters.falls.wrapping_add(1);
                return Some(Action::Fell { place: at, why });
            }
            if place.drive.take_news() {
                let emergency = self.manager.status(place.drive.axis().node).emergency;
                let current = place.drive.is_current();
                return Some(Action::Reported { place: at, report: place.drive.report(emergency), current });
            }
        }
        None
    }

    /// Begins the transfers that the drives want.
    fn begin(&mut self, now: Instant) {
        for place in &mut self.places {
            if place.yields(now) {
                continue;
            }
            place.yields_until = None;
            let Some(job) = place.drive.job() else {
                continue;
            };
            let transfer = match job.write {
                None => Transfer::Upload { address: job.object.address, block: false },
                Some(_) => {
                    let size = job.object.kind.size() as u32;
                    Transfer::Download { address: job.object.address, size, block: false }
                }
            };
            if self.manager.submit(now, place.drive.axis().node, transfer).is_ok() {
                place.read.clear();
                place.long = false;
                place.refused = false;
                place.drive.begin();
            }
        }
    }

    /// What the manager says, where it is not for the drives alone.
    fn managed(&mut self, now: Instant, action: manager::Action) -> Option<Action> {
        match action {
            manager::Action::Transmit(frame) => return Some(Action::Transmit(frame)),
            manager::Action::Idle => return Some(Action::Idle),
            manager::Action::Sdo(node, ref sdo) => {
                let own = |place: &&mut Place| place.drive.axis().node == node;
                if let Some(place) = self.places.iter_mut().find(own)
                    && let Some(job) = place.drive.working()
                {
                    match sdo {
                        Sdo::Fetch { offset, count } => {
                            let bytes = job.write.unwrap_or(0).to_le_bytes();
                            let from = usize::try_from(*offset).unwrap_or(usize::MAX);
                            let part = bytes.get(from..).and_then(|rest| rest.get(..*count));
                            self.manager.supply(now, node, part.unwrap_or_default());
                        }
                        Sdo::Data(part) => place.long |= place.read.extend_from_slice(part).is_err(),
                        Sdo::Done(end) => place.done(now, end.map(|_| ())),
                    }
                    return None;
                }
            }
            manager::Action::Node(node, event) => {
                for place in &mut self.places {
                    if place.drive.axis().node == node {
                        place.drive.happened(now, event);
                    }
                }
            }
            manager::Action::Bus(
                BusEvent::Off | BusEvent::On | BusEvent::Babbling(_) | BusEvent::Quiet(_),
            )
            | manager::Action::Lss(_) => {}
        }
        Some(Action::Manager(action))
    }
}

impl Place {
    /// Whether a caller has to wait for the drive's own transfer.
    fn refuses(&mut self, now: Instant) -> bool {
        if self.drive.working().is_some() {
            self.refused = true;
            return true;
        }
        self.drive.job().is_some() && !self.yields(now)
    }

    /// Whether a caller is the next.
    fn yields(&self, now: Instant) -> bool {
        self.yields_until.is_some_and(|until| now < until)
    }

    /// Its own transfer is over.
    fn done(&mut self, now: Instant, end: Result<(), Failure>) {
        self.yields_until = core::mem::take(&mut self.refused).then_some(now + PATIENCE);
        let end = match end {
            // What has more bytes than any object of a drive has the wrong size, whatever it is.
            Ok(()) if self.long => Ok(&[0; 5][..]),
            Ok(()) => Ok(&self.read[..]),
            Err(failure) => Err(failure),
        };
        self.drive.answered(now, end);
    }

    fn poll_at(&self, up: bool) -> Option<Instant> {
        let waits = self.yields_until.filter(|_| self.drive.job().is_some());
        [self.drive.poll_at(up), waits].into_iter().flatten().min()
    }
}

impl Drive {
    /// Something happened to its node.
    fn happened(&mut self, now: Instant, event: Event) {
        match event {
            Event::Monitor(Sign::BootUp) => self.rebooted(now),
            Event::Monitor(Sign::Lost(_)) => self.lost(),
            Event::Monitor(Sign::Started(state) | Sign::Changed { to: state, .. }) => self.network(state),
            Event::Monitor(Sign::Resumed(state)) => {
                self.resumed(now);
                self.network(state);
            }
            Event::DuplicateId(_) => self.duplicate(),
            Event::Monitor(Sign::Toggle) => {}
            Event::Emergency(emergency) => {
                self.emergency((emergency.code != 0).then_some(emergency.code));
            }
            Event::Booted => self.booted(now),
            Event::NotBooted(verdict) => self.refused(verdict),
            Event::Missing | Event::Declined(..) => {}
        }
    }
}
