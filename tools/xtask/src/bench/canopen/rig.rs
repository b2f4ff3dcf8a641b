//! A bus with a master and simulated drives, in virtual time.

use std::time::Duration;

use puente_canopen::boot::{Plan, Signs};
use puente_canopen::cob::Function;
use puente_canopen::dcf::List;
use puente_canopen::manager::{self, Config, Member};
use puente_canopen::monitor::Supervision;
use puente_canopen::sdo::Transfer;
use puente_canopen::{Address, Frame, Id, NodeId};
use puente_cell::can::bus::{Event, Order};
use puente_cell::can::{self, Cell, DriveConfig, Model};
use puente_drives::cia402::{Mode, Profile};
use puente_line::Instant;
use puente_servos::{Action, Axis, Master, Motion, Order as Wanted, Progress, setup};

/// bit/s.
pub const BITRATE: u32 = 1_000_000;
/// From one SYNC to the next.
pub const PERIOD: Duration = Duration::from_millis(1);
/// A heartbeat of each node so often, ms.
const HEARTBEAT: u16 = 1_000;
/// A client asks again after this: no gateway is so fast that the bus is not free in between.
pub const PAUSE: Duration = Duration::from_micros(10);
/// All axes follow after this at the latest.
const START: Duration = Duration::from_secs(10);
/// A path goes to and fro in so many cycles of 1 ms,
const PATH: i32 = 2_000;
/// this far each of them, position units.
const STEP: i32 = 20;

type Own = Master<'static, 3, 3, 3>;

/// Frames of a kind, and the bits that they take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Share {
    pub frames: u64,
    pub bits: u64,
}

impl Share {
    fn add(&mut self, frame: &Frame) {
        self.frames += 1;
        self.bits += u64::from(frame.bits());
    }
}

/// What was on a bus.
#[derive(Clone, Copy, Debug, Default)]
pub struct Figures {
    /// SYNC periods that were looked at.
    pub cycles: u64,
    /// Of these, those in which a set-point or an answer of an axis was missing, twice there, or out of its place.
    pub missed: u64,
    /// By kind, as the stations sent them.
    pub sync: Share,
    pub set_points: Share,
    pub answers: Share,
    pub others: Share,
    /// What the bus itself has counted.
    pub bus: Share,
    /// How long SYNC waited for the bus at most.
    pub blocked: Duration,
    /// From one SYNC to the next, shortest and longest.
    pub shortest: Duration,
    pub longest: Duration,
    /// From the end of SYNC to the end of the last frame of its cycle, at most.
    pub busy: Duration,
    /// Transfers of the client.
    pub transfers: u64,
}

impl Figures {
    /// Bits that the frames take which were sent.
    pub fn computed(&self) -> u64 {
        [self.sync, self.set_points, self.answers, self.others].iter().map(|share| share.bits).sum()
    }

    /// The part of the time in which the bus was in use, percent.
    pub fn load(&self, bits: u64) -> f64 {
        bits as f64 / (self.cycles as f64 * PERIOD.as_secs_f64() * f64::from(BITRATE)) * 100.0
    }
}

/// The frames of an axis in a SYNC cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Cycle {
    set_points: u8,
    answers: u8,
}

/// One of each, and no more.
const WHOLE: Cycle = Cycle { set_points: 1, answers: 1 };

/// A bus, its master, and its drives.
pub struct Rig {
    cell: Cell,
    master: Box<Own>,
    now: Instant,
    /// The drives, and where each stood when it began to follow.
    axes: Vec<(NodeId, i32)>,
    follow: Vec<bool>,
    /// The paths have begun: so many cycles ago.
    path: Option<i32>,
    /// A client reads an object of the first drive again and again,
    client: bool,
    /// from then on; `None`: not now.
    reads: Option<Instant>,
    /// What the bus has shown of the cycle since the last SYNC, whose end was then.
    cycle: Vec<Cycle>,
    sync: Option<Instant>,
    last: Instant,
    counts: bool,
    /// What the bus had counted before.
    before: Share,
    figures: Figures,
}

impl Rig {
    /// A bus with drives of these node-IDs.
    ///
    /// # Errors
    /// One that says what is wrong with them.
    pub fn new(nodes: &[u8], client: bool) -> Result<Self, String> {
        // As the mailboxes of a board's controller do.
        let mut config = can::Config { order: Order::Identifier, ..can::Config::new(BITRATE) };
        let (mut axes, mut members) = (Vec::new(), Vec::new());
        for node in nodes {
            let drive = DriveConfig::new(*node, Model::Lexium23a).ok_or("a node-ID is 1 to 127")?;
            config = config.with(drive);
            let node = NodeId::new(*node).ok_or("a node-ID is 1 to 127")?;
            let axis =
                Axis { cyclic: Some(Mode::InterpolatedPosition), ..Axis::new(node, &Profile::LEXIUM_23A) };
            members.push(member(&axis)?);
            axes.push(axis);
        }
        let now = Instant::from_millis(10);
        let config_of_master = Config { sync: PERIOD, ..Config::new(NodeId::MAX) };
        let mut master = Box::new(Master::new(config_of_master, members, axes.iter().copied(), now));
        master.start(now);
        Ok(Self {
            cell: Cell::new(config),
            master,
            now,
            axes: axes.iter().map(|axis| (axis.node, 0)).collect(),
            follow: vec![false; axes.len()],
            path: None,
            client,
            reads: None,
            cycle: vec![Cycle::default(); axes.len()],
            sync: None,
            last: now,
            counts: false,
            before: Share::default(),
            figures: Figures { shortest: Duration::MAX, ..Figures::default() },
        })
    }

    /// Whether all drives follow, where they stand; those that are there are told to.
    fn follows(&mut self) -> bool {
        for place in 0..self.axes.len() {
            if self.master.order(place) == Wanted::Observe {
                // What it has fallen from does not count before this.
                self.master.set(self.now, place, Wanted::Observe);
                self.master.set(self.now, place, Wanted::Hold);
            }
        }
        self.follow.iter().all(|follows| *follows)
    }

    /// From now on it is measured.
    fn begin(&mut self) {
        self.reads = self.client.then_some(self.now);
        (self.counts, self.sync) = (true, None);
        self.before = self.totals();
    }

    /// What was measured.
    fn end(&mut self) -> Figures {
        self.close();
        let after = self.totals();
        let bus = Share { frames: after.frames - self.before.frames, bits: after.bits - self.before.bits };
        Figures { bus, ..self.figures }
    }

    /// What the bus has counted so far.
    fn totals(&self) -> Share {
        let totals = self.cell.totals();
        Share { frames: totals.frames, bits: totals.bits }
    }

    /// When something happens next.
    fn poll_at(&self) -> Option<Instant> {
        let reads = self.reads.filter(|at| *at > self.now);
        [self.master.poll_at(), self.cell.poll_at(), reads].into_iter().flatten().min()
    }

    /// It is now so late.
    fn advance(&mut self, now: Instant) {
        self.now = now;
        while let Some(heard) = self.cell.hear(now, 0) {
            self.count(&heard.frame);
            self.master.receive(now, &heard.frame);
        }
        self.look();
    }

    /// Does what the master asks for.
    fn act(&mut self) -> Result<(), String> {
        loop {
            if self.reads.is_some_and(|at| at <= self.now)
                && let Some((node, _)) = self.axes.first()
            {
                let transfer = Transfer::Upload { address: Address::new(0x1000, 0), block: false };
                if self.master.submit(self.now, *node, transfer).is_ok() {
                    // Until it is done.
                    self.reads = Some(Instant::from_micros(u64::MAX));
                }
            }
            match self.master.poll(self.now) {
                Action::Idle => return Ok(()),
                Action::Transmit(frame) => {
                    self.count(&frame);
                    self.cell.send(self.now, 0, &frame);
                    if frame.id() == SYNC {
                        self.step();
                    }
                }
                Action::Reported { place, report, .. } => {
                    if let (Some((_, base)), Some(here), None) =
                        (self.axes.get_mut(place), report.position, self.path)
                        && matches!(self.master.order(place), Wanted::Hold)
                        && report.progress == Progress::Reached
                    {
                        *base = here;
                        self.master.set(self.now, place, Wanted::Move(Motion::Interpolate(here)));
                    } else if let Some(follows) = self.follow.get_mut(place) {
                        *follows = matches!(self.master.order(place), Wanted::Move(_))
                            && report.progress == Progress::Reached;
                    }
                }
                Action::Fell { place, why } if self.path.is_some() => {
                    return Err(format!("axis {place} fell: {why}"));
                }
                Action::Manager(manager::Action::Sdo(_, manager::Sdo::Done(end))) => {
                    self.figures.transfers += u64::from(end.is_ok());
                    self.reads = self.reads.map(|_| self.now + PAUSE);
                }
                _ => {}
            }
        }
    }

    /// The next set-points, which go after this SYNC.
    fn step(&mut self) {
        let Some(step) = &mut self.path else { return };
        *step = (*step + 1) % (2 * PATH);
        let offset = STEP * if *step < PATH { *step } else { 2 * PATH - *step };
        for (place, (_, base)) in self.axes.iter().enumerate() {
            let target = base.wrapping_add(offset);
            self.master.set(self.now, place, Wanted::Move(Motion::Interpolate(target)));
        }
    }

    /// A frame that a station has sent.
    fn count(&mut self, frame: &Frame) {
        if !self.counts {
            return;
        }
        let share = match Function::of(frame.id()) {
            Some(Function::Sync) => &mut self.figures.sync,
            Some(Function::Rpdo(4, _)) => &mut self.figures.set_points,
            Some(Function::Tpdo(3, _)) => &mut self.figures.answers,
            _ => &mut self.figures.others,
        };
        share.add(frame);
    }

    /// Looks at what has been on the bus.
    fn look(&mut self) {
        for event in self.cell.take_events() {
            let Event::Frame(sent) = event else { continue };
            if !self.counts {
                continue;
            }
            let place = |node| self.axes.iter().position(|(axis, _)| *axis == node);
            match Function::of(sent.frame.id()) {
                Some(Function::Sync) => {
                    self.close();
                    if let Some(last) = self.sync.replace(sent.at) {
                        let period = sent.at.since(last);
                        self.figures.shortest = self.figures.shortest.min(period);
                        self.figures.longest = self.figures.longest.max(period);
                    }
                    self.figures.blocked = self.figures.blocked.max(sent.waited);
                }
                Some(Function::Rpdo(4, node)) => {
                    if let Some(cycle) = place(node).and_then(|place| self.cycle.get_mut(place)) {
                        cycle.set_points += 1;
                        self.last = sent.at;
                    }
                }
                Some(Function::Tpdo(3, node)) => {
                    if let Some(cycle) = place(node).and_then(|place| self.cycle.get_mut(place)) {
                        cycle.answers += 1;
                        self.last = sent.at;
                    }
                }
                _ => {}
            }
        }
    }

    /// A cycle is over.
    fn close(&mut self) {
        let Some(sync) = self.sync else { return };
        self.figures.cycles += 1;
        self.figures.missed += u64::from(self.cycle.iter().any(|cycle| *cycle != WHOLE));
        self.figures.busy = self.figures.busy.max(self.last.since(sync));
        self.cycle.fill(Cycle::default());
    }
}

/// Buses that have nothing in common but the time, at once.
pub struct Buses(Vec<Rig>);

impl Buses {
    /// These buses, as soon as all drives follow their paths.
    ///
    /// # Errors
    /// One that does not.
    pub fn start(buses: Vec<Rig>) -> Result<Self, String> {
        let mut buses = Self(buses);
        let end = buses.now() + START;
        // Each of them is told, whatever the others are at.
        while buses.0.iter_mut().filter_map(|bus| (!bus.follows()).then_some(())).count() > 0 {
            if buses.now() >= end {
                return Err("a drive does not follow".into());
            }
            buses.run(buses.now() + PERIOD)?;
        }
        buses.0.iter_mut().for_each(|bus| bus.path = Some(0));
        buses.run(buses.now() + PERIOD * 100)?;
        Ok(buses)
    }

    /// Measures for a time: whole periods, from a moment at which nothing is under way.
    ///
    /// # Errors
    /// A drive that falls.
    pub fn measure(mut self, time: Duration) -> Result<Vec<Figures>, String> {
        let syncs: Vec<_> = self.0.iter().map(|bus| bus.master.manager().sync_at()).collect();
        let sync = syncs.first().copied().flatten().ok_or("there is no SYNC")?;
        if syncs.iter().any(|other| *other != Some(sync)) {
            return Err("the buses have no SYNC at the same time".into());
        }
        self.run(sync.before())?;
        self.0.iter_mut().for_each(Rig::begin);
        // What the client has asked for is answered by then.
        self.run(sync + time.saturating_sub(PERIOD * 5))?;
        self.0.iter_mut().for_each(|bus| bus.reads = None);
        self.run((sync + time).before())?;
        Ok(self.0.iter_mut().map(Rig::end).collect())
    }

    fn now(&self) -> Instant {
        self.0.first().map_or(Instant::ZERO, |bus| bus.now)
    }

    /// Lets time pass, for all of them.
    fn run(&mut self, end: Instant) -> Result<(), String> {
        self.0.iter_mut().try_for_each(Rig::act)?;
        while self.now() < end {
            let next = self.0.iter().filter_map(Rig::poll_at).min();
            let now = next.unwrap_or(end).max(self.now()).min(end);
            for bus in &mut self.0 {
                bus.advance(now);
                bus.act()?;
            }
        }
        Ok(())
    }
}

const SYNC: Id = Id::Base(puente_canopen::cob::SYNC);

/// The node of an axis, with what it is told when it boots.
fn member(axis: &Axis) -> Result<Member<'static>, String> {
    let mut list: heapless::Vec<u8, { setup::MOST }> = heapless::Vec::new();
    setup::push(&mut list, axis, PERIOD).map_err(|_| "no room for the set-up of a drive")?;
    // As long as the program.
    let list: &'static [u8] = list.to_vec().leak();
    let configuration = List::parse(list).map_err(|error| error.to_string())?;
    let plan = Plan { configuration, signs: Signs::Heartbeat(HEARTBEAT), starts: true, ..Plan::NOTHING };
    let supervision = Supervision::Heartbeat { timeout: Duration::from_millis(2 * u64::from(HEARTBEAT)) };
    Ok(Member { plan, supervision, ..Member::new(axis.node) })
}
