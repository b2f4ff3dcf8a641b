//! The manager under any frames, calls and pauses.

mod common;

use std::collections::BTreeSet;

use common::any_frame;
use common::bus::node;
use proptest::prelude::*;
use puente_canopen::boot::{Plan, Signs};
use puente_canopen::dcf::List;
use puente_canopen::manager::{Action, Config, Event, Manager, Member, Sdo};
use puente_canopen::monitor::Supervision;
use puente_canopen::nmt::{Command, Sign, State};
use puente_canopen::sdo::{self, Transfer};
use puente_canopen::{Address, Frame, Id, cob, lss};
use puente_line::{Duration, Instant};

#[derive(Clone, Debug)]
enum Step {
    Hear(Frame),
    Sign(u8, u8),
    /// An SDO response to what a boot or a caller reads.
    Answer(u8, u8, Vec<u8>),
    Pass(u64),
    Submit(u8, bool, bool, u32),
    Cancel(u8),
    Pause(u8, bool),
    Command(u8, u8),
    Lss(bool),
    Bus(bool),
    /// The port is full: only what is told is asked for.
    Report,
}

fn step() -> impl Strategy<Value = Step> {
    let id = || 1..5_u8;
    prop_oneof![
        3 => any_frame().prop_map(Step::Hear),
        3 => (id(), prop_oneof![Just(0), Just(5), Just(0x7F), any::<u8>()]).prop_map(|(of, state)| Step::Sign(of, state)),
        6 => (id(), prop_oneof![Just(0x43), Just(0x60), Just(0x41), Just(0x80), any::<u8>()], prop::collection::vec(any::<u8>(), 4))
            .prop_map(|(of, first, rest)| Step::Answer(of, first, rest)),
        4 => prop_oneof![0..2_000_u64, 0..2_000_000_u64].prop_map(Step::Pass),
        3 => (id(), any::<bool>(), any::<bool>(), 0..40_u32).prop_map(|(of, block, write, size)| Step::Submit(of, block, write, size)),
        1 => id().prop_map(Step::Cancel),
        1 => (id(), any::<bool>()).prop_map(|(of, paused)| Step::Pause(of, paused)),
        1 => (0..5_u8, any::<u8>()).prop_map(|(to, which)| Step::Command(to, which)),
        1 => any::<bool>().prop_map(Step::Lss),
        1 => any::<bool>().prop_map(Step::Bus),
        1 => Just(Step::Report),
    ]
}

fn members() -> Vec<Member<'static>> {
    const LIST: &[u8] = &[1, 0, 0, 0, 0, 0x14, 1, 9, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9];
    let heartbeat = Supervision::Heartbeat { timeout: Duration::from_millis(300) };
    let guarding = Supervision::Guarding { time: Duration::from_millis(100), factor: 2 };
    let configuration = List::parse(LIST).expect("a list");
    let plan = Plan { configuration, device_type: Some(0x0002_0192), starts: true, ..Plan::NOTHING };
    let member = |id| Member { plan, supervision: heartbeat, ..Member::new(node(id)) };
    vec![
        member(1),
        Member { supervision: guarding, optional: true, ..member(2) },
        Member { plan: Plan { signs: Signs::Heartbeat(100), ..Plan::NOTHING }, reset: true, ..member(3) },
        // Given twice, and the manager's own.
        member(1),
        member(127),
    ]
}

/// Where the data of an answer belong: what was asked for last.
fn answer(of: u8, first: u8, rest: &[u8], asked: &[Address; 5]) -> Frame {
    let mut bytes = [first, 0, 0, 0, rest[0], rest[1], rest[2], rest[3]];
    bytes[1..4].copy_from_slice(&asked[usize::from(of)].to_bytes());
    Frame::full(Id::Base(0x580 + u16::from(of)), bytes)
}

struct Run {
    manager: Manager<'static, 3, 2>,
    now: Instant,
    open: BTreeSet<u8>,
    lss: bool,
    up: bool,
    /// What each node was asked for last.
    asked: [Address; 5],
    syncs: u64,
}

const SYNC: u64 = 30_000;
const START: u64 = 1_000_000;

impl Run {
    fn new() -> Self {
        let now = Instant::from_micros(START);
        let config = Config { sync: Duration::from_micros(SYNC), ..Config::new(node(127)) };
        let mut manager = Manager::new(config, members(), now);
        manager.start(now);
        let asked = [Address::new(0x1000, 0); 5];
        Self { manager, now, open: BTreeSet::new(), lss: false, up: true, asked, syncs: 0 }
    }

    fn step(&mut self, step: Step) {
        let now = self.now;
        match step {
            Step::Hear(frame) => self.manager.receive(now, &frame),
            Step::Sign(of, byte) => {
                let frame = Frame::new(Id::Base(0x700 + u16::from(of)), &[byte]).expect("a byte");
                self.manager.receive(now, &frame);
            }
            Step::Answer(of, first, rest) => {
                let frame = answer(of, first, &rest, &self.asked);
                self.manager.receive(now, &frame);
            }
            Step::Pass(micros) => self.now += Duration::from_micros(micros),
            Step::Submit(of, block, write, size) => {
                let address = Address::new(0x2000, of);
                let transfer = match write {
                    true => Transfer::Download { address, size, block },
                    false => Transfer::Upload { address, block },
                };
                if self.manager.submit(now, node(of), transfer).is_ok() {
                    assert!(self.open.insert(of), "two transfers with one node");
                }
            }
            Step::Cancel(of) => self.manager.cancel(now, node(of)),
            Step::Pause(of, paused) => self.manager.pause(node(of), paused),
            Step::Command(to, which) => {
                let command = Command::from_code([1, 2, 0x80, 0x81, 0x82][usize::from(which) % 5]);
                let command = command.expect("a command");
                let to = puente_canopen::NodeId::new(to);
                assert!(self.manager.command(now, command, to).is_ok() <= self.up);
            }
            Step::Lss(scan) => {
                let command = match scan {
                    true => lss::Command::Fastscan(lss::Known::default()),
                    false => lss::Command::InquireNodeId,
                };
                assert_eq!(self.manager.lss(now, command, None).is_err(), self.lss);
                self.lss = true;
            }
            Step::Bus(up) => {
                self.manager.bus(now, up);
                self.up = up;
            }
            Step::Report => {
                let mut steps = 0;
                while let Some(action) = self.manager.report(now) {
                    assert!(!matches!(
                        action,
                        Action::Transmit(_) | Action::Sdo(_, Sdo::Fetch { .. }) | Action::Idle
                    ));
                    self.act(action);
                    steps += 1;
                    assert!(steps < 200, "it does not end");
                }
                return;
            }
        }
        self.settle();
    }

    fn settle(&mut self) {
        for _ in 0..2_000 {
            match self.manager.poll(self.now) {
                Action::Idle => {
                    let at = self.manager.poll_at();
                    assert!(
                        at.is_none_or(|at| at > self.now),
                        "polling would spin: {at:?} at {:?}",
                        self.now
                    );
                    return;
                }
                action => self.act(action),
            }
        }
        panic!("it does not end");
    }

    fn act(&mut self, action: Action) {
        match action {
            Action::Transmit(frame) => {
                assert!(self.up, "nothing is sent while the bus is off");
                if frame.id() == Id::Base(cob::SYNC) {
                    self.syncs += 1;
                }
                if let Some(cob::Function::SdoRequest(of)) = cob::Function::of(frame.id())
                    && let &[_, low, high, sub, ..] = frame.data()
                    && let Some(asked) = self.asked.get_mut(usize::from(of.value()))
                {
                    *asked = Address::from_bytes([low, high, sub]);
                }
            }
            Action::Sdo(of, Sdo::Fetch { offset, count }) => {
                assert!(self.open.contains(&of.value()) && offset + count as u32 <= 40);
                self.manager.supply(self.now, of, &[7; 7][..count]);
            }
            Action::Sdo(of, Sdo::Data(part)) => {
                assert!(self.open.contains(&of.value()) && !part.is_empty());
            }
            Action::Sdo(of, Sdo::Done(_)) => assert!(self.open.remove(&of.value()), "an end of nothing"),
            Action::Node(of, event) => {
                if matches!(event, Event::Booted | Event::NotBooted(_) | Event::Missing) {
                    assert!((1..=3).contains(&of.value()));
                    assert!(event != Event::Missing || of != node(2), "it is optional");
                }
            }
            Action::Lss(_) => assert!(std::mem::take(&mut self.lss), "an end of nothing"),
            Action::Bus(_) => {}
            Action::Idle => unreachable!("handled before"),
        }
    }
}

proptest! {
    #[test]
    fn nothing_spins_and_everything_ends_once(steps in prop::collection::vec(step(), 0..200)) {
        let mut run = Run::new();
        for step in steps {
            run.step(step);
        }
        // Left alone on its bus, with nobody paused, all that was begun ends.
        run.step(Step::Bus(true));
        for of in 1..5 {
            run.step(Step::Pause(of, false));
        }
        let end = run.now + Duration::from_secs(20);
        while let Some(at) = run.manager.poll_at().filter(|at| *at < end) {
            run.now = run.now.max(at);
            run.settle();
        }
        prop_assert_eq!((run.open.len(), run.lss), (0, false));
        let counters = run.manager.counters();
        // One at the start, and one a period.
        let due = (run.now.as_micros() - START) / SYNC + 1;
        prop_assert_eq!(run.syncs + u64::from(counters.sync_missed), due);
        // Whoever was silent for so long is not there.
        for id in 1..=3 {
            prop_assert_ne!(run.manager.status(node(id)).health, puente_canopen::manager::Health::Booted);
        }
    }

}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// A member that answers rightly is booted in the end, whatever happened before.
    #[test]
    fn a_member_that_answers_is_booted(steps in prop::collection::vec(step(), 0..100)) {
        let mut run = Run::new();
        for step in steps {
            run.step(step);
        }
        run.step(Step::Bus(true));
        run.step(Step::Pause(1, false));
        // It may have been booted before.
        run.manager.command(run.now, Command::ResetNode, None).expect("room");
        run.settle();
        let end = run.now + Duration::from_secs(20);
        let mut beat = run.now;
        let mut booted = false;
        while run.now < end && !booted {
            let next = run.manager.poll_at().unwrap_or(end).min(beat).max(run.now);
            run.now = next;
            run.settle();
            if run.now >= beat {
                beat += Duration::from_millis(100);
                run.manager.receive(run.now, &Sign { node: node(1), state: State::Operational, toggle: false }.frame());
                run.settle();
            }
            // Its SDO server answers every message: reads with the device type, segments and writes with a confirmation.
            for first in [0x43, 0x60, 0x20, 0x30] {
                run.step(Step::Answer(1, first, vec![0x92, 0x01, 0x02, 0x00]));
            }
            run.now += Duration::from_micros(500);
            booted = run.manager.status(node(1)).health == puente_canopen::manager::Health::Booted;
        }
        prop_assert!(booted);
    }
}

#[test]
fn a_write_of_nothing_and_of_everything_is_a_write() {
    let mut run = Run::new();
    run.settle();
    for size in [0, 4, 5] {
        let transfer = Transfer::Download { address: Address::new(0x2000, 0), size, block: true };
        assert_eq!(run.manager.submit(run.now, node(4), transfer), Ok(()));
        run.open.insert(4);
        run.settle();
        run.manager.cancel(run.now, node(4));
        run.settle();
        assert!(run.open.is_empty());
        assert_eq!(
            run.manager.submit(run.now, node(4), transfer),
            Ok(()),
            "its own channel, quiet for a while"
        );
        run.open.insert(4);
        run.manager.cancel(run.now, node(4));
        run.settle();
    }
    // The first, and what the first member was asked.
    assert_eq!(run.manager.counters().sdo, sdo::Counters { transfers: 2, ..sdo::Counters::default() });
}
