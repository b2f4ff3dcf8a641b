//! The manager with nodes of another implementation, zencan-node, on a bus that loses nothing.
//!
//! What they do otherwise than the standard: see `peer.rs`; and their boot-up message says that they are pre-operational, so
//! that it is taken for a heartbeat.

mod common;

use std::collections::VecDeque;

use common::bus::node;
use common::channel::Random;
use common::zencan::Peer;
use puente_canopen::boot::{Plan, Verdict};
use puente_canopen::lss::{Known, Part};
use puente_canopen::manager::{Action, Config, Event, Evidence, Health, Manager, Member, Sdo};
use puente_canopen::monitor::{self, Supervision};
use puente_canopen::nmt::{Command, State};
use puente_canopen::sdo::{Failure, Outcome, Transfer};
use puente_canopen::{Address, Frame};
use puente_line::{Duration, Instant};

struct Bus {
    now: Instant,
    manager: Manager<'static, 4, 4>,
    peers: Vec<Peer>,
    coming: VecDeque<Frame>,
    told: Vec<(u8, Event)>,
    writes: Vec<u8>,
    read: Vec<(u8, Vec<u8>)>,
    done: Vec<(u8, Result<Outcome, Failure>)>,
}

impl Bus {
    fn new(members: &[Member<'static>], peers: Vec<Peer>) -> Self {
        let now = Instant::from_millis(1_000);
        let mut manager = Manager::new(Config::new(node(127)), members.iter().copied(), now);
        manager.start(now);
        let (told, read, done) = (Vec::new(), Vec::new(), Vec::new());
        Self { now, manager, peers, coming: VecDeque::new(), told, writes: Vec::new(), read, done }
    }

    /// So many milliseconds pass, in steps of one.
    fn run(&mut self, millis: u64) {
        for _ in 0..millis {
            self.now += Duration::from_millis(1);
            self.carry(None);
            self.poll();
        }
    }

    fn carry(&mut self, frame: Option<&Frame>) {
        for peer in &mut self.peers {
            self.coming.extend(peer.take(self.now, frame));
        }
    }

    fn poll(&mut self) {
        for _ in 0..1_000_000 {
            if let Some(frame) = self.coming.pop_front() {
                self.manager.receive(self.now, &frame);
            }
            match self.manager.poll(self.now) {
                Action::Transmit(frame) => self.carry(Some(&frame)),
                Action::Sdo(of, Sdo::Fetch { offset, count }) => {
                    let bytes = &self.writes[offset as usize..][..count];
                    self.manager.supply(self.now, of, bytes);
                }
                Action::Sdo(of, Sdo::Data(part)) => {
                    match self.read.iter_mut().find(|(id, _)| *id == of.value()) {
                        Some((_, read)) => read.extend_from_slice(&part),
                        None => self.read.push((of.value(), part.to_vec())),
                    }
                }
                Action::Sdo(of, Sdo::Done(end)) => self.done.push((of.value(), end)),
                Action::Node(of, event) => self.told.push((of.value(), event)),
                Action::Bus(_) | Action::Lss(_) => panic!("nobody asked"),
                Action::Idle if self.coming.is_empty() => return,
                Action::Idle => {}
            }
        }
        panic!("it does not end");
    }
}

fn member(id: u8, serial: u32) -> Member<'static> {
    let identity = Known { vendor: Some(1), product: Some(2), revision: Some(3), serial: Some(serial) };
    let supervision = Supervision::Off;
    Member { plan: Plan { identity, starts: true, ..Plan::NOTHING }, supervision, ..Member::new(node(id)) }
}

const BOOT_UP: Event = Event::Monitor(monitor::Event::Started(State::PreOperational));

#[test]
fn they_are_judged_started_read_and_written() {
    let peers = vec![Peer::new(2, [1, 2, 3, 42]), Peer::new(3, [1, 2, 3, 43]), Peer::new(4, [1, 2, 3, 99])];
    let mut bus = Bus::new(&[member(2, 42), member(3, 43), member(4, 44)], peers);
    bus.run(20);
    let verdict = Verdict::Identity { part: Part::Serial, expected: 44, received: 99 };
    for (id, end) in [(2, Event::Booted), (3, Event::Booted), (4, Event::NotBooted(verdict))] {
        let events: Vec<_> = bus.told.iter().filter(|(of, _)| *of == id).map(|(_, event)| *event).collect();
        assert_eq!(events, [BOOT_UP, end], "{id}");
    }
    assert_eq!(bus.manager.status(node(4)).health, Health::Refused(verdict));
    bus.told.clear();
    // Two at the same time, in blocks.
    let address = Address::new(0x2000, 0);
    bus.writes = Random(1).bytes(20_001);
    for id in [2, 3] {
        let write = Transfer::Download { address, size: 20_001, block: true };
        bus.manager.submit(bus.now, node(id), write).expect("a channel");
    }
    bus.run(10);
    for id in [2, 3] {
        bus.manager.submit(bus.now, node(id), Transfer::Upload { address, block: true }).expect("a channel");
    }
    bus.run(10);
    let (written, read) = (Ok(Outcome::Written), Ok(Outcome::Read { size: 20_001, checked: true }));
    bus.done.sort_by_key(|(id, _)| *id);
    assert_eq!(bus.done, [(2, written), (2, read), (3, written), (3, read)]);
    for (_, data) in &bus.read {
        assert!(*data == bus.writes);
    }
    // What they abort of object 0000h:0 after each block upload is no second node.
    assert_eq!(bus.told, []);
}

#[test]
fn a_reset_boots_them_again() {
    let mut bus = Bus::new(&[member(2, 42)], vec![Peer::new(2, [1, 2, 3, 42])]);
    bus.run(20);
    bus.told.clear();
    bus.manager.command(bus.now, Command::ResetNode, Some(node(2))).expect("room");
    bus.run(200);
    assert_eq!(bus.told, [(2, BOOT_UP), (2, Event::Booted)]);
}

/// Two of the same node-ID, of which one is another: the second response of each pair shows it.
#[test]
fn two_of_the_same_node_id_are_told() {
    let peers = vec![Peer::new(2, [1, 2, 3, 42]), Peer::new(2, [1, 2, 3, 77])];
    let mut bus = Bus::new(&[member(2, 42)], peers);
    bus.run(20);
    let serial = Transfer::Upload { address: Address::new(0x1018, 4), block: false };
    for _ in 0..3 {
        let _ = bus.manager.submit(bus.now, node(2), serial);
        bus.run(20);
    }
    let told = bus.told.iter().filter(|(_, event)| *event == Event::DuplicateId(Evidence::Response)).count();
    assert_eq!(told, 1, "{:?}", bus.told);
}
