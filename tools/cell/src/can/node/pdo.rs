//! Process data of a node (7.2.2).

use std::time::Duration;

use puente_canopen::pdo::{CobId, Direction, MAX_MAPPED, Mapped, Pdo, Transmission};
use puente_canopen::{Address, Frame, Id};
use puente_line::Instant;

use super::Objects;
use super::communication::PDOS;

/// Indexes below are dummies: bits that nobody takes.
const DUMMIES: u16 = 8;

/// How a PDO is set up.
#[derive(Debug)]
struct Layout {
    cob_id: CobId,
    transmission: Transmission,
    inhibit: Duration,
    event_timer: Duration,
    sync_start: u8,
    mapping: Vec<Mapped>,
}

impl Layout {
    fn read(objects: &Objects, direction: Direction, number: u16) -> Option<Self> {
        let pdo = Pdo::new(direction, number)?;
        let parameter = |sub| objects.get(pdo.communication(sub));
        let count = objects.get(pdo.mapping(0)).min(MAX_MAPPED as i64) as u8;
        Some(Self {
            cob_id: CobId::from_raw(parameter(1) as u32),
            transmission: Transmission::from_code(parameter(2) as u8).unwrap_or(Transmission::EventProfile),
            inhibit: Duration::from_micros(100 * parameter(3) as u64),
            event_timer: Duration::from_millis(parameter(5) as u64),
            sync_start: parameter(6) as u8,
            mapping: (1..=count).map(|sub| Mapped::from_raw(objects.get(pdo.mapping(sub)) as u32)).collect(),
        })
    }

    fn bytes(&self) -> usize {
        puente_canopen::pdo::bytes(&self.mapping)
    }

    fn is_event_driven(&self) -> bool {
        matches!(self.transmission, Transmission::EventVendor | Transmission::EventProfile)
    }
}

/// Values that a PDO brought.
pub type Values = Vec<(Address, Vec<u8>)>;

/// What became of a frame.
#[derive(Debug, PartialEq, Eq)]
pub enum Received {
    /// Objects are written now.
    Values {
        /// They.
        values: Values,
        /// The PDO had more bytes than are mapped.
        long: bool,
    },
    /// It is kept until the next SYNC.
    Kept,
    /// It has fewer bytes than are mapped.
    Short,
}

#[derive(Debug)]
struct Receive {
    layout: Layout,
    waiting: Option<Values>,
}

#[derive(Debug)]
struct Transmit {
    layout: Layout,
    /// What was sent last.
    sent: Option<Vec<u8>>,
    /// It is to be sent, since its values have changed, or its timer has run out.
    due: bool,
    not_before: Instant,
    timer: Option<Instant>,
    /// SYNCs since the last one; `None`: it waits for its SYNC start value.
    syncs: Option<u8>,
    /// Sampled at SYNC, for a request.
    sample: Option<Frame>,
}

/// The PDOs of a node.
#[derive(Debug)]
pub struct Pdos {
    receive: Vec<Receive>,
    transmit: Vec<Transmit>,
    operational: bool,
}

impl Pdos {
    /// As the dictionary says.
    pub fn new(objects: &Objects) -> Self {
        let layouts =
            |direction| (1..=PDOS).filter_map(move |number| Layout::read(objects, direction, number));
        Self {
            receive: layouts(Direction::Receive).map(|layout| Receive { layout, waiting: None }).collect(),
            transmit: layouts(Direction::Transmit).map(Transmit::new).collect(),
            operational: false,
        }
    }

    /// The dictionary has changed.
    pub fn rebuild(&mut self, now: Instant, objects: &Objects) {
        let operational = self.operational;
        *self = Self::new(objects);
        if operational {
            self.start(now);
        }
    }

    /// The node is operational: what is sent on an event is sent once.
    pub fn start(&mut self, now: Instant) {
        self.operational = true;
        for pdo in &mut self.transmit {
            pdo.due = pdo.layout.is_event_driven();
            pdo.start_timer(now);
        }
    }

    /// The node is not operational.
    pub fn stop(&mut self) {
        self.operational = false;
        for pdo in &mut self.receive {
            pdo.waiting = None;
        }
    }

    /// Takes a frame; `None` where it is no PDO of this node.
    pub fn receive(&mut self, frame: &Frame) -> Option<Received> {
        if !self.operational || frame.is_remote() {
            return None;
        }
        let pdo = self.receive.iter_mut().find(|pdo| pdo.layout.has(frame.id()))?;
        if frame.data().len() < pdo.layout.bytes() {
            return Some(Received::Short);
        }
        let mut rest = frame.data();
        let mut values = Vec::new();
        for mapped in &pdo.layout.mapping {
            let (value, after) = rest.split_at(usize::from(mapped.bits / 8).min(rest.len()));
            rest = after;
            if mapped.address.index >= DUMMIES {
                values.push((mapped.address, value.to_vec()));
            }
        }
        if pdo.layout.is_event_driven() {
            return Some(Received::Values { values, long: !rest.is_empty() });
        }
        pdo.waiting = Some(values);
        Some(Received::Kept)
    }

    /// A SYNC: the values that waited for it.
    pub fn sync(&mut self) -> Values {
        self.receive.iter_mut().filter_map(|pdo| pdo.waiting.take()).flatten().collect()
    }

    /// What is sent at a SYNC, with its counter where it has one.
    pub fn at_sync(&mut self, counter: Option<u8>, objects: &Objects) -> Vec<Frame> {
        if !self.operational {
            return Vec::new();
        }
        self.look(objects);
        self.transmit.iter_mut().filter_map(|pdo| pdo.at_sync(counter, objects)).collect()
    }

    /// The answer to a frame that asks for a PDO.
    pub fn answer(&mut self, frame: &Frame, objects: &Objects) -> Option<Frame> {
        if !self.operational || !frame.is_remote() {
            return None;
        }
        let asked = |pdo: &&mut Transmit| pdo.layout.has(frame.id()) && pdo.layout.cob_id.remote;
        let pdo = self.transmit.iter_mut().find(asked)?;
        match pdo.layout.transmission {
            Transmission::RemoteSync => pdo.sample.take(),
            _ => pdo.frame(objects),
        }
    }

    /// Values may have changed.
    pub fn look(&mut self, objects: &Objects) {
        if !self.operational {
            return;
        }
        for pdo in self.transmit.iter_mut().filter(|pdo| pdo.layout.cob_id.valid && !pdo.due) {
            let changed = pdo.sent.as_ref() != Some(&pdo.layout.data(objects));
            pdo.due = changed
                && (pdo.layout.is_event_driven() || pdo.layout.transmission == Transmission::SyncAcyclic);
        }
    }

    /// A PDO that is to be sent because of an event.
    pub fn poll(&mut self, now: Instant, objects: &Objects) -> Option<Frame> {
        if !self.operational {
            return None;
        }
        self.transmit.iter_mut().find_map(|pdo| pdo.poll(now, objects))
    }

    /// When one is to be sent.
    pub fn poll_at(&self) -> Option<Instant> {
        let transmit = self.transmit.iter().filter(|_| self.operational);
        transmit.filter_map(Transmit::poll_at).min()
    }
}

impl Layout {
    fn has(&self, id: Id) -> bool {
        self.cob_id.valid && self.cob_id.id == id
    }

    fn data(&self, objects: &Objects) -> Vec<u8> {
        let values = self.mapping.iter().filter_map(|mapped| objects.read(mapped.address).ok());
        values.flatten().copied().collect()
    }
}

impl Transmit {
    fn new(layout: Layout) -> Self {
        let syncs = (layout.sync_start == 0).then_some(0);
        Self { layout, sent: None, due: false, not_before: Instant::ZERO, timer: None, syncs, sample: None }
    }

    fn start_timer(&mut self, now: Instant) {
        let runs = self.layout.is_event_driven() && !self.layout.event_timer.is_zero();
        self.timer = runs.then(|| now + self.layout.event_timer);
    }

    fn frame(&mut self, objects: &Objects) -> Option<Frame> {
        let data = self.layout.data(objects);
        let frame = Frame::new(self.layout.cob_id.id, &data);
        self.sent = Some(data);
        frame.filter(|_| self.layout.cob_id.valid)
    }

    fn poll(&mut self, now: Instant, objects: &Objects) -> Option<Frame> {
        self.due |= self.timer.is_some_and(|timer| timer <= now);
        if !self.due || !self.layout.is_event_driven() || now < self.not_before {
            return None;
        }
        self.due = false;
        self.not_before = now + self.layout.inhibit;
        self.start_timer(now);
        self.frame(objects)
    }

    fn poll_at(&self) -> Option<Instant> {
        if !self.layout.cob_id.valid || !self.layout.is_event_driven() {
            return None;
        }
        let due = self.due.then_some(Instant::ZERO);
        [due, self.timer].into_iter().flatten().min().map(|at| at.max(self.not_before))
    }

    fn at_sync(&mut self, counter: Option<u8>, objects: &Objects) -> Option<Frame> {
        match self.layout.transmission {
            Transmission::SyncAcyclic if self.due => {
                self.due = false;
                self.frame(objects)
            }
            Transmission::SyncCyclic(every) => {
                // A SYNC without a counter leaves nothing to wait for.
                let begins = counter.is_none_or(|counter| counter == self.layout.sync_start);
                let syncs = match self.syncs {
                    None if begins => every,
                    None => return None,
                    Some(syncs) => syncs + 1,
                };
                self.syncs = Some(if syncs >= every { 0 } else { syncs });
                if syncs >= every { self.frame(objects) } else { None }
            }
            Transmission::RemoteSync => {
                self.sample = self.frame(objects);
                None
            }
            _ => None,
        }
    }
}
