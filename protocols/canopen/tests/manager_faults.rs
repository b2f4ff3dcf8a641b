//! The manager with simulated nodes that fail: what is told, and that the others go on.

mod common;

use common::bus::{Bus, Node, node};
use common::ms;
use puente_canopen::boot::{Plan, Signs, Verdict};
use puente_canopen::dcf::{self, Entry, List};
use puente_canopen::emcy::Emergency;
use puente_canopen::lss::{self, Known, Part};
use puente_canopen::manager::{BusEvent, Config, Event, Evidence, Health, Member, Unsent};
use puente_canopen::monitor::{Event as Sign, Supervision};
use puente_canopen::nmt::{self, Command, State};
use puente_canopen::sdo::{Abort, Failure, Outcome, Transfer};
use puente_canopen::{Address, Frame, Id, cob, object};
use puente_line::{Duration, Instant};

const HEARTBEAT: Supervision = Supervision::Heartbeat { timeout: Duration::from_millis(250) };
const GUARDING: Supervision = Supervision::Guarding { time: Duration::from_millis(100), factor: 3 };

fn config() -> Config {
    Config::new(node(127))
}

fn member(id: u8) -> Member<'static> {
    let identity = Known { vendor: Some(0x80), serial: Some(u32::from(id)), ..Known::default() };
    let plan = Plan { identity, signs: Signs::Heartbeat(100), starts: true, ..Plan::NOTHING };
    Member { plan, supervision: HEARTBEAT, ..Member::new(node(id)) }
}

fn guarded(id: u8) -> Member<'static> {
    let plan = Plan { signs: Signs::Guarding { time: 100, factor: 3 }, ..member(id).plan };
    Member { plan, supervision: GUARDING, ..member(id) }
}

const READ: Transfer = Transfer::Upload { address: Address::new(0x2000, 0), block: false };
const READ_BLOCK: Transfer = Transfer::Upload { address: Address::new(0x2000, 0), block: true };

/// Nodes 2 and 3, booted.
fn both(members: [Member<'_>; 2]) -> Bus<'_, 4, 2> {
    let nodes = members.iter().map(|member| Node::new(member.id.value())).collect();
    let mut bus = Bus::started(config(), &members, nodes);
    bus.run(500);
    assert_eq!(bus.manager.missing().count(), 0);
    bus.told.clear();
    bus
}

/// Node 3 does what it did.
fn goes_on<const N: usize, const C: usize>(bus: &mut Bus<'_, N, C>) {
    assert_eq!(bus.events(3), []);
    let status = bus.manager.status(node(3));
    assert_eq!((status.health, status.state), (Health::Booted, Some(State::Operational)));
    bus.done.clear();
    bus.submit(3, READ);
    bus.run(400);
    assert!(bus.done.contains(&(3, Ok(Outcome::Read { size: 3_000, checked: true }))));
}

const OPERATIONAL: Event = Event::Monitor(Sign::Started(State::Operational));

#[test]
fn a_node_is_lost_by_its_heartbeat_and_booted_when_it_comes_again() {
    let mut bus = both([member(2), member(3)]);
    let since = bus.now;
    bus.node(2).switch_off();
    bus.run(400);
    let (at, _) = bus.told[0];
    // Its last heartbeat came up to 100 ms before.
    assert!((150..=251).contains(&at.since(since).as_millis()), "{at:?}");
    assert_eq!(bus.events(2), [Event::Monitor(Sign::Lost(HEARTBEAT))]);
    let status = bus.manager.status(node(2));
    assert_eq!((status.health, status.state), (Health::Lost, None));
    assert_eq!(bus.manager.missing().collect::<Vec<_>>(), [node(2)]);
    bus.run(10_000);
    assert_eq!(bus.events(2), [], "told once, however often it is tried");
    goes_on(&mut bus);
    bus.reset(2);
    bus.run(500);
    assert_eq!(bus.events(2), [Event::Monitor(Sign::BootUp), Event::Booted, OPERATIONAL]);
    goes_on(&mut bus);
}

#[test]
fn a_node_is_lost_by_guarding_and_booted_when_it_comes_again() {
    let mut bus = both([guarded(2), member(3)]);
    let since = bus.now;
    bus.node(2).switch_off();
    bus.run(400);
    assert!((200..=301).contains(&bus.told[0].0.since(since).as_millis()), "{:?}", bus.told[0]);
    assert_eq!(bus.events(2), [Event::Monitor(Sign::Lost(GUARDING))]);
    assert_eq!(bus.manager.status(node(2)).health, Health::Lost);
    goes_on(&mut bus);
    bus.reset(2);
    bus.run(500);
    assert_eq!(bus.events(2), [Event::Monitor(Sign::BootUp), Event::Booted, OPERATIONAL]);
}

/// Its frames are lost for a while; it has lost nothing, so nothing is written to a drive that may be moving.
#[test]
fn who_comes_back_as_he_was_is_left_alone() {
    for with in [member(2), guarded(2)] {
        let mut bus = both([with, member(3)]);
        let written = bus.node(2).server.written.len();
        bus.node(2).mute = true;
        bus.run(700);
        assert_eq!(bus.events(2), [Event::Monitor(Sign::Lost(with.supervision))]);
        bus.node(2).mute = false;
        let since = bus.now;
        bus.run(5_000);
        assert_eq!(bus.events(2), [Event::Monitor(Sign::Resumed(State::Operational))]);
        assert_eq!(bus.manager.status(node(2)).health, Health::Booted);
        assert_eq!(bus.node(2).server.written.len(), written);
        assert_eq!(bus.commands(since), []);
        goes_on(&mut bus);
    }
}

/// It has booted, and its boot-up message was lost.
#[test]
fn who_comes_back_otherwise_is_booted() {
    let mut bus = both([guarded(2), member(3)]);
    bus.node(2).mute = true;
    bus.run(400);
    bus.reset(2);
    bus.run(100);
    bus.node(2).mute = false;
    bus.run(3_000);
    let events = bus.events(2);
    assert_eq!(events[0], Event::Monitor(Sign::Lost(GUARDING)));
    assert!(events.contains(&Event::Booted), "{events:?}");
    let status = bus.manager.status(node(2));
    assert_eq!((status.health, status.state), (Health::Booted, Some(State::Operational)));
    // The heartbeat of one that is reset is off: it is found by asking.
    bus.node(3).mute = true;
    bus.run(400);
    bus.reset(3);
    bus.run(100);
    bus.node(3).mute = false;
    bus.run(3_000);
    assert_eq!(bus.events(3), [Event::Monitor(Sign::Lost(HEARTBEAT)), Event::Booted, OPERATIONAL]);
}

#[test]
fn who_leaves_its_state_by_itself_is_led_there_again() {
    let mut bus = both([member(2), member(3)]);
    bus.node(2).state = Some(State::PreOperational);
    let since = bus.now;
    bus.run(3_000);
    assert_eq!(bus.commands(since), [(Command::Start, Some(node(2)))]);
    let there = Sign::Changed { from: State::Operational, to: State::PreOperational };
    let back = Sign::Changed { from: State::PreOperational, to: State::Operational };
    assert_eq!(bus.events(2), [Event::Monitor(there), Event::Booted, Event::Monitor(back)]);
    goes_on(&mut bus);
    // One that never stays there is configured less and less often.
    let booted = bus.manager.counters().booted;
    for _ in 0..10_000 {
        bus.node(2).state = Some(State::PreOperational);
        bus.run(10);
    }
    let again = bus.manager.counters().booted - booted;
    assert!((5..=6).contains(&again), "{again} in 100 s");
    // Well for long, it is led there at once again.
    bus.run(200_000);
    bus.node(2).state = Some(State::PreOperational);
    bus.run(1_500);
    assert_eq!(bus.node(2).state, Some(State::Operational));
    bus.events(2);
    goes_on(&mut bus);
}

#[test]
fn a_wrong_node_is_told_once_left_alone_and_tried_again() {
    let expects_7 = Known { vendor: Some(0x80), serial: Some(7), ..Known::default() };
    let wrong = Member { plan: Plan { identity: expects_7, ..member(2).plan }, ..member(2) };
    let mut bus = Bus::<4, 2>::started(config(), &[wrong, member(3)], vec![Node::new(2), Node::new(3)]);
    bus.run(4_500);
    let verdict = Verdict::Identity { part: Part::Serial, expected: 7, received: 2 };
    assert_eq!(bus.events(2), [Event::NotBooted(verdict)]);
    assert_eq!(bus.manager.status(node(2)).health, Health::Refused(verdict));
    assert_eq!(bus.node(2).server.written, []);
    assert_eq!(bus.node(2).state, Some(State::PreOperational));
    // It can be asked what it is.
    bus.submit(2, READ);
    bus.run(400);
    assert!(bus.done.iter().any(|(of, end)| *of == 2 && end.is_ok()));
    bus.node(2).server.objects.insert((0x1018, 4), vec![7, 0, 0, 0]);
    bus.run(5_000);
    assert_eq!(bus.events(2), [Event::Booted, OPERATIONAL]);
    bus.told.clear();
    goes_on(&mut bus);
}

#[test]
fn a_wish_that_is_declined_is_told_and_no_more() {
    let mut list = heapless::Vec::<u8, 64>::new();
    let missing = Address::new(0x1A07, 1);
    for address in [missing, Address::new(0x1400, 1)] {
        dcf::push(&mut list, Entry { address, data: &[1] }).expect("room");
    }
    let plan = Plan { wishes: List::parse(&list).expect("a list"), ..member(2).plan };
    let wished = Member { plan, ..member(2) };
    let mut bus = Bus::<4, 2>::started(config(), &[wished, member(3)], vec![Node::new(2), Node::new(3)]);
    bus.run(3_000);
    let events = bus.events(2);
    assert_eq!(events[..2], [Event::Declined(missing, Abort::NO_OBJECT), Event::Booted]);
    assert!(bus.node(2).server.written.iter().any(|((index, _), _)| *index == 0x1400), "those after it");
    bus.told.clear();
    goes_on(&mut bus);
}

#[test]
fn a_configuration_that_is_refused_is_told_with_its_object() {
    let mut list = heapless::Vec::<u8, 32>::new();
    let address = Address::new(0x1A07, 1);
    dcf::push(&mut list, Entry { address, data: &[1] }).expect("room");
    let plan = Plan { configuration: List::parse(&list).expect("a list"), ..member(2).plan };
    let refuses = Member { plan, ..member(2) };
    let mut bus = Bus::<4, 2>::started(config(), &[refuses, member(3)], vec![Node::new(2), Node::new(3)]);
    bus.run(3_000);
    let verdict = Verdict::Failed { address, failure: Failure::Aborted(Abort::NO_OBJECT) };
    assert_eq!(bus.events(2), [Event::NotBooted(verdict)]);
    assert_eq!(verdict.to_string(), "1A07h:1: the node refused: 0x06020000 object does not exist");
    // What was written before it is not written again and again.
    let mut list = heapless::Vec::<u8, 64>::new();
    for (index, sub) in [(0x1400, 1), (0x1A07, 1)] {
        dcf::push(&mut list, Entry { address: Address::new(index, sub), data: &[1] }).expect("room");
    }
    let plan = Plan { configuration: List::parse(&list).expect("a list"), ..member(2).plan };
    let mut bus = Bus::<4, 2>::started(config(), &[Member { plan, ..refuses }], vec![Node::new(2)]);
    bus.run(600_000);
    let written = bus.node(2).server.written.len();
    // After 0, 1, 3, 7, .. 63 s, and then every 64.
    assert_eq!(written, 7 + (600 - 63) / 64);
    bus.reset(2);
    bus.run(500);
    assert_eq!(bus.node(2).server.written.len(), written + 1, "one that boots is tried at once");
    let long = Member { plan: Plan { device_type: Some(1), ..Plan::NOTHING }, ..Member::new(node(2)) };
    let mut bus = Bus::<4, 2>::started(config(), &[long], vec![Node::new(2)]);
    bus.node(2).server.objects.insert((0x1000, 0), vec![0; 100]);
    bus.run(800);
    let verdict = Verdict::Size { address: object::DEVICE_TYPE, received: 7 };
    assert_eq!(bus.events(2), [Event::NotBooted(verdict)]);
    assert_eq!(bus.node(2).server.aborts, [0x0800_0021; 2], "it is not read to its end");
}

#[test]
fn a_mandatory_node_that_is_missing_is_told_an_optional_one_is_not() {
    let optional = Member { optional: true, ..member(4) };
    let members = [member(2), optional, member(3)];
    let nodes = vec![Node::off(2), Node::off(4), Node::new(3)];
    let mut bus = Bus::<4, 2>::started(config(), &members, nodes);
    bus.run(10_000);
    assert_eq!((bus.events(2), bus.events(4)), (vec![Event::Missing], vec![]));
    assert_eq!(bus.events(3), [Event::Booted, OPERATIONAL]);
    assert_eq!(bus.manager.missing().collect::<Vec<_>>(), [node(2)]);
    goes_on(&mut bus);
    // One is switched on; of the other the boot-up message is lost.
    bus.reset(2);
    bus.node(4).state = Some(State::PreOperational);
    bus.run(4_000);
    assert_eq!(bus.events(2), [Event::Monitor(Sign::BootUp), Event::Booted, OPERATIONAL]);
    assert_eq!(bus.events(4), [Event::Booted, OPERATIONAL]);
}

/// However many members are missing, callers have a channel.
#[test]
fn missing_members_leave_a_channel_to_callers() {
    let members: Vec<_> = (10..20).map(member).collect();
    let mut bus = Bus::<16, 2>::started(config(), &members, vec![Node::new(3)]);
    for _ in 0..20 {
        bus.submit(3, READ_BLOCK);
        bus.run(150);
    }
    assert_eq!(bus.done.len(), 20);
    // A refused one can be asked why, however many others are tried.
    bus.nodes.push(Node::new(12));
    bus.node(12).server.objects.insert((0x1018, 4), vec![0; 4]);
    bus.run(30_000);
    bus.done.clear();
    let asks = (0..400).filter(|_| {
        let _ =
            bus.manager.submit(bus.now, node(12), Transfer::Upload { address: object::SERIAL, block: false });
        bus.run(25);
        bus.done.drain(..).any(|(of, end)| of == 12 && end.is_ok())
    });
    let asks = asks.count();
    assert!(asks > 350, "{asks} of 400");
    // And callers leave one to members, even if they ask whenever they may.
    bus.nodes.push(Node::new(15));
    let (mut busy, mut at) = (0, 0);
    while !bus.manager.nodes().any(|(id, status)| id == node(15) && status.health == Health::Booted) {
        for id in [3, 4] {
            busy += u32::from(bus.manager.submit(bus.now, node(id), READ).is_err());
        }
        bus.run(10);
        at += 1;
        assert!(at < 3_000);
    }
    assert!(busy > 0);
}

#[test]
fn a_server_that_dies_ends_the_transfer_and_nothing_else() {
    for transfer in [READ, READ_BLOCK] {
        let mut bus = both([member(2), member(3)]);
        bus.submit(2, transfer);
        bus.run(20);
        assert!(!bus.read[&2].is_empty());
        bus.node(2).dead = true;
        bus.run(5_000);
        assert_eq!(bus.done, [(2, Err(Failure::Timeout { heard: None }))], "{transfer:?}");
        assert_eq!(bus.events(2), [], "its heartbeat goes on");
        goes_on(&mut bus);
        bus.node(2).dead = false;
        bus.done.clear();
        bus.submit(2, transfer);
        bus.run(500);
        assert_eq!(bus.done, [(2, Ok(Outcome::Read { size: 3_000, checked: true }))], "{transfer:?}");
    }
}

#[test]
fn a_server_that_dies_while_it_is_booted_is_told_and_tried_again() {
    let mut bus = both([member(2), member(3)]);
    bus.reset(2);
    bus.node(2).dead = true;
    bus.run(4_000);
    let failure = Failure::Timeout { heard: None };
    let verdict = Verdict::Failed { address: object::VENDOR, failure };
    assert_eq!(bus.events(2), [Event::Monitor(Sign::BootUp), Event::NotBooted(verdict)]);
    goes_on(&mut bus);
    bus.node(2).dead = false;
    bus.run(4_000);
    assert_eq!(bus.events(2), [Event::Booted, OPERATIONAL]);
}

#[test]
fn a_boot_up_ends_a_transfer_at_once() {
    let mut bus = both([member(2), member(3)]);
    bus.submit(2, READ);
    bus.run(10);
    bus.reset(2);
    bus.run(30);
    assert_eq!(bus.done, [(2, Err(Failure::Booted))]);
    bus.run(30);
    assert_eq!(bus.events(2), [Event::Monitor(Sign::BootUp), Event::Booted]);
    assert_eq!(bus.node(2).server.aborts, [], "it knows of nothing");
    // And one in the midst of its boot begins it anew.
    bus.reset(2);
    let since = bus.now;
    bus.run(20);
    bus.say(nmt::Sign { node: node(2), state: State::BootUp, toggle: false }.frame());
    bus.run(50);
    assert_eq!(bus.commands(since), [(Command::Start, Some(node(2)))]);
    goes_on(&mut bus);
}

#[test]
fn bus_off_fails_transfers_at_once_and_judges_the_nodes_anew() {
    let config = Config { sync: Duration::from_millis(10), ..config() };
    let members = [member(2), member(3)];
    let mut bus = Bus::<4, 2>::started(config, &members, vec![Node::new(2), Node::new(3)]);
    bus.run(500);
    bus.told.clear();
    bus.submit(2, READ);
    bus.manager.lss(bus.now, lss::Command::InquireNodeId, None).expect("idle");
    bus.run(10);
    bus.manager.bus(bus.now, false);
    bus.nodes.iter_mut().for_each(|node| node.mute = true);
    let since = bus.now;
    bus.run(1_000);
    assert_eq!(bus.done, [(2, Err(Failure::BusOff))]);
    assert_eq!(bus.bus_events(), [BusEvent::Off]);
    let sent = bus.sent.iter().filter(|(at, _)| *at > since);
    assert_eq!(sent.count(), 0, "nothing is sent");
    assert_eq!(bus.manager.command(bus.now, Command::Start, None), Err(Unsent::Off));
    assert_eq!(bus.events(2), [Event::Monitor(Sign::Lost(HEARTBEAT))]);
    bus.submit(3, READ);
    bus.manager.lss(bus.now, lss::Command::InquireNodeId, None).expect("idle");
    bus.run(1);
    assert_eq!(bus.done.pop(), Some((3, Err(Failure::BusOff))));
    // Node 3 has lost its supply meanwhile.
    bus.reset(3);
    bus.run(100);
    bus.manager.bus(bus.now, true);
    bus.nodes.iter_mut().for_each(|node| node.mute = false);
    let since = bus.now;
    bus.run(3_000);
    assert_eq!(bus.bus_events(), [BusEvent::On]);
    assert_eq!(bus.events(2), [Event::Monitor(Sign::Resumed(State::Operational))]);
    assert_eq!(bus.events(3), [Event::Monitor(Sign::Lost(HEARTBEAT)), Event::Booted, OPERATIONAL]);
    assert_eq!(bus.commands(since), [(Command::Start, Some(node(3)))]);
    let counters = bus.manager.counters();
    assert_eq!((counters.bus_offs, counters.sync_missed), (1, 109));
    // The first comes at once; the grid has not moved.
    let syncs = bus.sent.iter().filter(|(at, frame)| *at > since && frame.id() == Id::Base(cob::SYNC));
    assert!(syncs.clone().all(|(at, _)| at.as_micros() % 10_000 < 200));
    assert_eq!(syncs.count(), 300);
    goes_on(&mut bus);
}

fn sign(id: u8, state: State, toggle: bool) -> Frame {
    nmt::Sign { node: node(id), state, toggle }.frame()
}

#[test]
fn the_managers_own_node_id_is_nobody_elses() {
    for frame in [
        sign(127, State::BootUp, false),
        sign(127, State::Operational, false),
        Emergency { code: 1, register: 1, vendor: [0; 5] }.frame(node(127)),
        Frame::full(Id::Base(node(127).sdo_response()), [0; 8]),
    ] {
        let mut bus = both([member(2), member(3)]);
        bus.say(frame);
        bus.run(5);
        bus.say(frame);
        bus.run(5);
        assert_eq!(bus.events(127), [Event::DuplicateId(Evidence::Own)], "{frame:?}");
        assert!(bus.manager.status(node(127)).duplicate);
        goes_on(&mut bus);
    }
}

/// Two nodes that differ answer one after the other.
#[test]
fn a_second_response_is_of_a_second_node() {
    let mut bus = both([member(2), member(3)]);
    let second = Frame::full(Id::Base(0x582), [0x43, 0, 0x10, 0, 1, 2, 3, 4]);
    let short = Transfer::Upload { address: object::DEVICE_TYPE, block: false };
    bus.submit(2, short);
    bus.run(2);
    assert_eq!(bus.done.len(), 1);
    bus.say(second);
    bus.say(second);
    bus.run(2);
    assert_eq!(bus.events(2), [Event::DuplicateId(Evidence::Response)]);
    assert!(bus.manager.status(node(2)).duplicate);
    goes_on(&mut bus);
    // One that boots is heard anew.
    bus.reset(2);
    bus.run(200);
    assert!(!bus.manager.status(node(2)).duplicate);
}

/// What comes late, unasked for a reason, or is somebody else's is none.
#[test]
fn a_late_response_is_no_second_node() {
    let mut bus = both([member(2), member(3)]);
    let response = |id: u16| Frame::full(Id::Base(0x580 + id), [0x43, 0, 0x10, 0, 1, 2, 3, 4]);
    let short = Transfer::Upload { address: object::DEVICE_TYPE, block: false };
    // Node 2 answers after two seconds and more.
    bus.node(2).dead = true;
    bus.submit(2, short);
    bus.run(3_000);
    assert_eq!(bus.done.pop(), Some((2, Err(Failure::Timeout { heard: None }))));
    bus.say(response(2));
    bus.run(5);
    // Node 3 is asked by somebody else, too.
    bus.say(Frame::full(Id::Base(0x603), [0x40, 0, 0x10, 0, 0, 0, 0, 0]));
    bus.run(1);
    bus.say(response(3));
    bus.run(5);
    // Node 3 is slow: asked twice, it answers twice.
    bus.reset(3);
    bus.run(500);
    bus.told.clear();
    bus.node(3).dead = true;
    bus.submit(3, short);
    bus.run(600);
    bus.say(response(3));
    bus.run(200);
    bus.say(response(3));
    bus.run(5);
    assert_eq!(bus.done.pop(), Some((3, Ok(Outcome::Read { size: 4, checked: true }))));
    assert_eq!(bus.events(3), []);
    bus.node(3).dead = false;
    // Of node 9 nothing is known; what node 10 aborts was begun before.
    bus.say(response(9));
    bus.say(Frame::full(Id::Base(0x58A), [0x80, 0, 0x10, 0, 0, 0, 4, 5]));
    bus.run(5);
    assert_eq!((bus.events(2), bus.events(9), bus.events(10)), (vec![], vec![], vec![]));
    goes_on(&mut bus);
}

#[test]
fn a_state_to_and_fro_is_of_two_nodes() {
    let mut bus = both([member(2), member(3)]);
    // Another node 2 says that it is pre-operational, each time after the first.
    for _ in 0..3 {
        bus.run(100);
        bus.say(sign(2, State::PreOperational, false));
    }
    bus.run(5);
    let events = bus.events(2);
    assert_eq!(events.iter().filter(|event| **event == Event::DuplicateId(Evidence::State)).count(), 1);
    goes_on(&mut bus);
    // A node that is led to and fro is one.
    for command in [Command::Stop, Command::Start, Command::Stop, Command::Start, Command::Stop] {
        bus.manager.command(bus.now, command, Some(node(3))).expect("room");
        bus.run(200);
    }
    assert!(!bus.manager.status(node(3)).duplicate);
    // And so is one that does it by itself once a minute.
    for state in [State::Operational, State::Stopped, State::Operational, State::Stopped, State::Operational]
    {
        bus.run(60_000);
        bus.say(sign(9, state, false));
    }
    bus.run(5);
    assert!(!bus.events(9).contains(&Event::DuplicateId(Evidence::State)));
}

#[test]
fn a_heartbeat_twice_as_often_is_of_two_nodes() {
    let mut bus = both([member(2), member(3)]);
    for _ in 0..12 {
        bus.run(100);
        bus.say(sign(2, State::Operational, false));
    }
    bus.run(5);
    assert_eq!(bus.events(2), [Event::DuplicateId(Evidence::Heartbeat)]);
    goes_on(&mut bus);
    // Now and then one more, as when a state is told at once, is none.
    for _ in 0..20 {
        bus.run(250);
        bus.say(sign(3, State::Operational, false));
    }
    assert!(!bus.manager.status(node(3)).duplicate);
}

#[test]
fn two_answers_to_guarding_are_of_two_nodes() {
    let mut bus = both([guarded(2), member(3)]);
    bus.run(1);
    bus.say(sign(2, State::Operational, false));
    bus.say(sign(2, State::Operational, true));
    bus.run(5);
    assert!(bus.events(2).contains(&Event::DuplicateId(Evidence::Guarding)));
    goes_on(&mut bus);
    // Somebody else guards it.
    let mut bus = both([guarded(2), member(3)]);
    bus.say(nmt::Sign::request(node(2)));
    bus.say(sign(2, State::Operational, false));
    bus.say(sign(2, State::Operational, true));
    bus.run(5);
    assert!(!bus.events(2).contains(&Event::DuplicateId(Evidence::Guarding)));
}

/// The babbler has the bus for itself wherever nobody of higher priority wants it.
#[test]
fn babbling_is_told_once_and_others_are_served() {
    let emergency = Emergency { code: 0x1000, register: 1, vendor: [0; 5] }.frame(node(60));
    for frame in [emergency, sign(60, State::Operational, false), Frame::full(Id::Base(0x7FF), [0; 8])] {
        let mut bus = both([member(2), member(3)]);
        bus.submit(2, READ);
        let since = bus.now;
        while bus.now.since(since) < Duration::from_millis(1_000) {
            bus.say(frame);
            bus.run_micros(200);
        }
        let told = bus.bus_events();
        assert_eq!(told, [BusEvent::Babbling(frame.id())], "{frame:?}");
        let events = bus.events(60).len();
        assert!(events <= 600, "{events} of 5000");
        assert_eq!(bus.done, [(2, Ok(Outcome::Read { size: 3_000, checked: true }))]);
        bus.run(300);
        assert_eq!(bus.bus_events(), [BusEvent::Quiet(frame.id())]);
        goes_on(&mut bus);
    }
    // Many frames of what is asked for are none.
    let mut bus = both([member(2), member(3)]);
    bus.node(2).server.objects.insert((0x2000, 0), vec![1; 20_000]);
    bus.submit(2, READ_BLOCK);
    bus.run(1_000);
    assert_eq!(bus.done, [(2, Ok(Outcome::Read { size: 20_000, checked: true }))]);
    assert_eq!(bus.bus_events(), []);
}

/// A slow reader with the least room that a block takes, and one frame of a hundred lost.
#[test]
fn a_long_read_survives_losses_and_a_slow_reader() {
    let mut bus = Bus::<4, 2>::started(config(), &[], vec![Node::new(2)]);
    let object: Vec<_> = (0..100_000_u64).map(|at| (at * at / 128) as u8).collect();
    bus.node(2).server.objects.insert((0x2000, 0), object.clone());
    bus.loses = 10;
    bus.rooms.insert(2, 896);
    bus.submit(2, READ_BLOCK);
    let mut read = Vec::new();
    for _ in 0..10_000 {
        bus.run(37);
        read.extend(bus.drain(2));
        if !bus.done.is_empty() {
            break;
        }
    }
    assert_eq!(bus.done, [(2, Ok(Outcome::Read { size: 100_000, checked: true }))]);
    assert!(read == object);
    assert!(bus.manager.counters().sdo.repeated > 100);
}

#[test]
fn on_a_bad_bus_members_are_booted_in_the_end() {
    let members = [member(2), guarded(3), member(4), guarded(5)];
    let nodes = (2..=5).map(Node::new).collect();
    let mut bus = Bus::<4, 2>::started(config(), &members, nodes);
    bus.loses = 100;
    bus.run(20_000);
    for id in 2..=5 {
        bus.reset(id);
    }
    bus.run(20_000);
    assert!(bus.told.len() > 20, "it was bad");
    bus.loses = 0;
    bus.run(5_000);
    for id in 2..=5 {
        let status = bus.manager.status(node(id));
        assert_eq!((status.health, status.state), (Health::Booted, Some(State::Operational)), "{id}");
        assert_eq!(bus.node(id).state, Some(State::Operational));
    }
}

#[test]
fn a_caller_that_goes_away_leaves_the_channel_to_others() {
    let mut bus = both([member(2), member(3)]);
    bus.submit(2, READ);
    bus.run(10);
    bus.manager.cancel(bus.now, node(2));
    bus.run(5);
    assert_eq!(bus.done, [(2, Err(Failure::Cancelled))]);
    assert_eq!(bus.node(2).server.aborts, [0x0800_0021]);
    let begun: Instant = bus.now;
    goes_on(&mut bus);
    assert!(bus.now > begun && bus.now < ms(10_000));
}
