//! The manager with simulated nodes: what it does when all is well.

mod common;

use common::bus::{Bus, FRAME, Node, Told, node};
use common::ms;
use puente_canopen::boot::{Plan, Signs};
use puente_canopen::emcy::Emergency;
use puente_canopen::lss::{self, Known};
use puente_canopen::manager::{Action, Config, Event, Health, Manager, Member, Unsent};
use puente_canopen::monitor::{self, Supervision};
use puente_canopen::nmt::{Command, Sign, State};
use puente_canopen::sdo::{self, Outcome, Transfer};
use puente_canopen::sync::Overflow;
use puente_canopen::time::TimeOfDay;
use puente_canopen::{Address, Frame, Id, cob};
use puente_line::{Duration, Instant};

const OWN: u8 = 127;
const HEARTBEAT: Supervision = Supervision::Heartbeat { timeout: Duration::from_millis(250) };

fn config() -> Config {
    Config::new(node(OWN))
}

/// A member that is checked, sends heartbeats and is started.
fn member(id: u8) -> Member<'static> {
    let identity = Known { vendor: Some(0x80), serial: Some(u32::from(id)), ..Known::default() };
    let plan = Plan { identity, signs: Signs::Heartbeat(100), starts: true, ..Plan::NOTHING };
    Member { plan, supervision: HEARTBEAT, ..Member::new(node(id)) }
}

const fn read(index: u16, block: bool) -> Transfer {
    Transfer::Upload { address: Address::new(index, 0), block }
}

const fn write(index: u16, size: u32, block: bool) -> Transfer {
    Transfer::Download { address: Address::new(index, 0), size, block }
}

#[test]
fn members_are_booted_and_started() {
    let mut bus = Bus::<16, 4>::started(config(), &[member(2), member(3)], vec![Node::new(2), Node::new(3)]);
    assert_eq!(bus.manager.missing().collect::<Vec<_>>(), [node(2), node(3)]);
    bus.run(50);
    let commands = bus.commands(Instant::ZERO);
    assert_eq!(commands, [(Command::Start, Some(node(2))), (Command::Start, Some(node(3)))]);
    assert_eq!((bus.events(2), bus.events(3)), (vec![Event::Booted], vec![Event::Booted]));
    assert_eq!(bus.manager.missing().count(), 0);
    bus.run(2_000);
    let status = bus.manager.status(node(2));
    assert_eq!((status.state, status.health), (Some(State::Operational), Health::Booted));
    assert_eq!(bus.events(2), [Event::Monitor(monitor::Event::Started(State::Operational))]);
    assert_eq!(bus.manager.counters().booted, 2);
    // It says itself that it has booted, and that it is operational.
    let signs: Vec<_> =
        bus.sent.iter().filter_map(|(_, frame)| Sign::parse(frame)).map(|s| s.state).collect();
    assert_eq!(signs, [State::BootUp, State::Operational, State::Operational]);
}

#[test]
fn a_boot_up_message_boots_again() {
    let mut bus = Bus::<4, 2>::started(config(), &[member(2)], vec![Node::new(2)]);
    bus.run(300);
    bus.told.clear();
    bus.reset(2);
    let since = bus.now;
    bus.run(40);
    let booted = [Event::Monitor(monitor::Event::BootUp), Event::Booted];
    assert_eq!(bus.events(2), booted);
    assert_eq!(bus.commands(since), [(Command::Start, Some(node(2)))]);
    bus.run(500);
    assert_eq!(bus.node(2).state, Some(State::Operational));
}

#[test]
fn resets_and_stops_of_the_master_are_no_faults() {
    let mut bus = Bus::<4, 2>::started(config(), &[member(2), member(3)], vec![Node::new(2), Node::new(3)]);
    bus.run(300);
    bus.told.clear();
    bus.manager.command(bus.now, Command::Stop, Some(node(2))).expect("room");
    bus.manager.command(bus.now, Command::ResetNode, Some(node(3))).expect("room");
    bus.run(5_000);
    let stopped = monitor::Event::Changed { from: State::Operational, to: State::Stopped };
    assert_eq!(bus.events(2), [Event::Monitor(stopped)], "and it is left so");
    assert_eq!(bus.manager.status(node(2)).health, Health::Booted);
    let again = [
        Event::Monitor(monitor::Event::BootUp),
        Event::Booted,
        Event::Monitor(monitor::Event::Started(State::Operational)),
    ];
    assert_eq!(bus.events(3), again);
    bus.manager.command(bus.now, Command::EnterPreOperational, None).expect("room");
    bus.run(3_000);
    assert_eq!(bus.node(2).state, Some(State::PreOperational));
    assert_eq!(bus.node(3).state, Some(State::PreOperational));
    assert_eq!(bus.manager.counters().booted, 3);
}

#[test]
fn communication_is_reset_at_the_start_where_that_is_wanted() {
    let wanted = Member { reset: true, ..member(2) };
    let mut bus = Bus::<4, 2>::started(config(), &[wanted, member(3)], vec![Node::new(2), Node::new(3)]);
    bus.run(500);
    let reset: Vec<_> = bus.commands(Instant::ZERO).into_iter().map(|(_, to)| to).collect();
    assert_eq!(bus.commands(Instant::ZERO)[0], (Command::ResetCommunication, Some(node(2))));
    assert_eq!(reset, [Some(node(2)), Some(node(3)), Some(node(2))]);
    assert_eq!(bus.manager.missing().count(), 0);
}

#[test]
fn sync_goes_first_on_an_even_grid() {
    let config = Config { sync: Duration::from_millis(1), overflow: Overflow::new(4), ..config() };
    let mut manager = Manager::<4, 2>::new(config, [member(2)], ms(0));
    manager.start(ms(10));
    manager.command(ms(10), Command::Start, None).expect("room");
    let sync = |count| Action::Transmit(Frame::new(Id::Base(cob::SYNC), &[count]).expect("a byte"));
    assert_eq!(manager.poll(ms(10)), sync(1));
    assert_eq!(manager.poll(ms(10)), Action::Transmit(Command::Start.frame(None)));
    // Late, and then in time again.
    assert_eq!(manager.poll(Instant::from_micros(11_900)), sync(2));
    assert_eq!(manager.poll(ms(12)), sync(3));
    assert_eq!(manager.counters().sync_missed, 0);
    // A whole period late: 13 and 14 are left out.
    assert_eq!(manager.poll(Instant::from_micros(15_100)), sync(4));
    assert_eq!(manager.counters().sync_missed, 2);
    assert_eq!(manager.poll(ms(16)), sync(1));
    while manager.poll(ms(16)) != Action::Idle {}
    assert_eq!(manager.poll_at(), Some(ms(17)));
}

#[test]
fn what_waits_goes_in_its_order() {
    let guarded = |id| {
        let supervision = Supervision::Guarding { time: Duration::from_millis(100), factor: 2 };
        Member { supervision, ..Member::new(node(id)) }
    };
    let second = Duration::from_secs(1);
    let config = Config { sync: second, time: second, heartbeat: second, ..config() };
    let mut bus = Bus::<4, 4>::started(config, &[guarded(2), guarded(3)], vec![Node::new(2), Node::new(3)]);
    bus.manager.set_time(bus.now, TimeOfDay::new(1, 0).expect("a time"));
    bus.run(950);
    let manager = &mut bus.manager;
    let late = ms(2_010);
    for id in [9, 8, 7] {
        manager.submit(late, node(id), read(0x1000, false)).expect("a channel");
    }
    manager.lss(late, lss::Command::InquireNodeId, None).expect("idle");
    manager.command(late, Command::Start, Some(node(2))).expect("room");
    manager.command(late, Command::Stop, None).expect("room");
    let mut ids = Vec::new();
    loop {
        match manager.poll(late) {
            Action::Transmit(frame) => ids.push(frame.id().raw()),
            Action::Idle => break,
            // What is told is told first, but for SYNC.
            _ => assert!(ids.len() == 1, "{ids:03X?}"),
        }
    }
    let transfers: Vec<_> = ids.split_off(8);
    assert_eq!(ids, [0x080, 0x000, 0x000, 0x77F, 0x100, 0x702, 0x703, 0x7E5]);
    assert_eq!(transfers, [0x609, 0x608, 0x607], "in the order of their channels");
}

#[test]
fn a_bus_full_of_transfers_leaves_sync_its_moment() {
    let config = Config { sync: Duration::from_millis(1), ..config() };
    let nodes = (1..=4).map(Node::new).collect();
    let mut bus = Bus::<4, 4>::started(config, &[], nodes);
    for _ in 0..5 {
        (1..=4).for_each(|id| bus.submit(id, read(0x2000, true)));
        bus.run(300);
    }
    let syncs: Vec<_> = bus.sent.iter().filter(|(_, frame)| frame.id() == Id::Base(cob::SYNC)).collect();
    assert_eq!(syncs.len(), 1_501);
    for (number, (at, _)) in syncs.iter().enumerate() {
        // Its place in the port may be asked for only when a frame ends.
        let late = at.since(ms(1_000 + number as u64));
        assert!(late <= FRAME, "{number}: {late:?}");
    }
    assert_eq!(bus.manager.counters().sync_missed, 0);
    assert_eq!(bus.done.len(), 20);
    assert!(bus.done.iter().all(|(_, end)| *end == Ok(Outcome::Read { size: 3_000, checked: true })));
}

#[test]
fn channels_take_turns() {
    let nodes: Vec<_> = (1..=4).map(Node::new).collect();
    let mut bus = Bus::<4, 4>::started(config(), &[], nodes);
    bus.run(5);
    bus.sent.clear();
    (1..=4).for_each(|id| {
        bus.writes.insert(id, vec![id; 2_000]);
        bus.submit(id, write(0x2000, 2_000, true));
    });
    bus.run(1_000);
    assert_eq!(bus.done.len(), 4);
    // While all four send a block, each has one frame of four.
    let to: Vec<_> = bus.sent.iter().map(|(_, frame)| frame.id().raw() - 0x600).collect();
    let fair = to[40..300].windows(4).filter(|four| (1..=4).all(|id| four.contains(&id))).count();
    assert!(fair > 200, "{fair} of 257");
    for id in 1..=4 {
        assert_eq!(bus.node(id).server.objects[&(0x2000, 0)], vec![id; 2_000]);
    }
}

#[test]
fn a_node_has_one_channel_and_all_nodes_share_those_there_are() {
    let mut bus = Bus::<4, 2>::started(config(), &[], (1..=3).map(Node::new).collect());
    bus.submit(1, read(0x1000, false));
    assert_eq!(bus.manager.submit(bus.now, node(1), read(0x1000, false)), Err(sdo::Busy));
    bus.submit(2, read(0x1000, false));
    assert_eq!(bus.manager.submit(bus.now, node(3), read(0x1000, false)), Err(sdo::Busy));
    bus.run(10);
    bus.submit(3, read(0x1000, false));
    bus.run(10);
    let four = Ok(Outcome::Read { size: 4, checked: true });
    assert_eq!(bus.done, [(1, four), (2, four), (3, four)]);
    assert_eq!(bus.drain(3), [0x92, 0x01, 0x02, 0]);
    // Node 4 is not there: its channel is not lent to others until nothing can come any more.
    let impatient = sdo::Config { retries: 0, ..sdo::Config::DEFAULT };
    bus.manager.submit_with(bus.now, node(4), read(0x1000, false), impatient).expect("a channel");
    let begun = bus.now;
    bus.run(510);
    assert_eq!(bus.done.last(), Some(&(4, Err(sdo::Failure::Timeout { heard: None }))));
    bus.submit(1, read(0x1000, false));
    assert_eq!(bus.manager.submit(bus.now, node(2), read(0x1000, false)), Err(sdo::Busy));
    let wakes = bus.manager.poll_at().filter(|at| *at > bus.now);
    bus.run(480);
    assert!(bus.now < begun + Duration::from_millis(1_000));
    bus.submit(1, read(0x1000, false));
    assert_eq!(bus.manager.submit(bus.now, node(2), read(0x1000, false)), Err(sdo::Busy));
    bus.run(20);
    bus.submit(1, read(0x1000, false));
    bus.submit(2, read(0x1000, false));
    assert!(wakes.is_none_or(|at| at <= begun + Duration::from_millis(1_001)));
    assert_eq!(bus.manager.counters().sdo.timeouts, 1);
}

/// A caller with 896 bytes of room that takes them away every 50 ms.
#[test]
fn a_slow_reader_holds_up_blocks_and_segments() {
    for block in [true, false] {
        let mut bus = Bus::<4, 2>::started(config(), &[], vec![Node::new(1), Node::new(2)]);
        bus.rooms.insert(1, 896);
        bus.submit(1, read(0x2000, block));
        let mut read_all = Vec::new();
        let mut rounds = 0;
        while bus.done.is_empty() {
            rounds += 1;
            bus.run(5_000);
            // Nobody else is held up.
            bus.submit(2, read(0x1000, false));
            bus.run(10);
            assert_eq!(bus.done.pop().map(|(id, end)| (id, end.is_ok())), Some((2, true)));
            read_all.extend(bus.drain(1));
            assert!(rounds < 1_000);
            bus.run(if block { 200 } else { 1 });
        }
        read_all.extend(bus.drain(1));
        assert_eq!(bus.done, [(1, Ok(Outcome::Read { size: 3_000, checked: true }))]);
        assert_eq!(read_all, bus.node(1).server.objects[&(0x2000, 0)]);
        assert!(rounds >= 3, "{rounds}");
        assert_eq!(bus.manager.counters().sdo.repeated, 0);
    }
}

#[test]
fn emergencies_are_told_and_kept() {
    let mut bus = Bus::<2, 2>::started(config(), &[member(2)], vec![Node::new(2)]);
    bus.run(50);
    bus.told.clear();
    let emergency = |code| Emergency { code, register: u8::from(code != 0), vendor: [0; 5] };
    for id in [2, 9, 10] {
        for code in [0x8130, 0x3210, 0x2310, 0x4210, 0xFF01] {
            bus.say(emergency(code).frame(node(id)));
        }
        bus.run(5);
    }
    let kept = |bus: &Bus<'_, 2, 2>, id| -> Vec<_> {
        bus.manager.emergencies(node(id)).map(|(_, emergency)| emergency.code).collect()
    };
    assert_eq!(kept(&bus, 2), [0x3210, 0x2310, 0x4210, 0xFF01]);
    assert_eq!(kept(&bus, 9), [0x3210, 0x2310, 0x4210, 0xFF01]);
    assert_eq!(kept(&bus, 10), [], "there is room for two nodes; it is told all the same");
    assert_eq!(bus.events(10).len(), 5);
    assert_eq!(bus.events(2)[1], Event::Emergency(emergency(0x3210)));
    assert_eq!(bus.manager.status(node(2)).emergency, Some(emergency(0xFF01)));
    bus.say(emergency(0).frame(node(2)));
    bus.run(5);
    assert_eq!(bus.manager.status(node(2)).emergency, None);
    assert_eq!(bus.manager.counters().emergencies, 16);
}

#[test]
fn every_node_that_is_heard_is_known() {
    let mut bus = Bus::<2, 2>::started(config(), &[member(2)], vec![]);
    let sign = |id, state| Sign { node: node(id), state, toggle: false }.frame();
    bus.run(50);
    bus.say(sign(30, State::BootUp));
    bus.say(sign(30, State::PreOperational));
    bus.run(2_000);
    bus.say(sign(30, State::Operational));
    bus.say(sign(30, State::Operational));
    bus.run(5);
    let changed = monitor::Event::Changed { from: State::PreOperational, to: State::Operational };
    let expected = [monitor::Event::BootUp, monitor::Event::Started(State::PreOperational), changed];
    assert_eq!(bus.events(30), expected.map(Event::Monitor));
    let known: Vec<_> =
        bus.manager.nodes().map(|(id, status)| (id.value(), status.state, status.heard)).collect();
    assert_eq!(known, [(2, None, None), (30, Some(State::Operational), Some(ms(3_000)))]);
    assert_eq!(bus.manager.status(node(30)).health, Health::Unmanaged);
}

#[test]
fn time_is_told_once_it_is_known() {
    let config = Config { time: Duration::from_secs(1), heartbeat: Duration::ZERO, ..config() };
    let mut bus = Bus::<2, 2>::started(config, &[], vec![]);
    bus.run(1_500);
    let told = |bus: &Bus<'_, 2, 2>| -> Vec<_> {
        bus.sent.iter().filter_map(|(at, frame)| Some((*at, TimeOfDay::parse(cob::TIME, frame)?))).collect()
    };
    assert_eq!(told(&bus), []);
    let midnight = TimeOfDay::new(15_000, 86_399_000).expect("a time");
    bus.manager.set_time(bus.now, midnight);
    bus.run(2_000);
    let expected = [(3_000, 15_000, 86_399_500), (4_000, 15_001, 500)];
    assert_eq!(
        told(&bus),
        expected.map(|(at, days, millis)| (ms(at), TimeOfDay::new(days, millis).expect("a time")))
    );
}

#[test]
fn lss_commands_end_once() {
    let mut bus = Bus::<2, 2>::started(config(), &[], vec![]);
    bus.manager.lss(bus.now, lss::Command::Fastscan(Known::default()), None).expect("idle");
    assert_eq!(bus.manager.lss(bus.now, lss::Command::InquireNodeId, None), Err(lss::Busy));
    bus.run(150);
    assert_eq!(bus.told.pop().map(|(_, told)| told), Some(Told::Lss(Err(lss::Failure::Nobody))));
    bus.manager.lss(bus.now, lss::Command::InquireNodeId, None).expect("idle");
    bus.run(1);
    bus.say(lss::Response::NodeId(9).frame());
    bus.run(1);
    assert_eq!(bus.told.pop().map(|(_, told)| told), Some(Told::Lss(Ok(lss::Outcome::NodeId(9)))));
}

/// A time-out is that of its command alone, and one that is given up ends at once.
#[test]
fn an_lss_command_may_have_its_own_time_out() {
    let mut bus = Bus::<2, 2>::started(config(), &[], vec![]);
    let scan = lss::Command::Fastscan(Known::default());
    let nobody = Some(Told::Lss(Err(lss::Failure::Nobody)));
    for (timeout, answered) in [(Some(10), 10), (None, 100), (Some(3_000), 3_000)] {
        bus.manager.lss(bus.now, scan, timeout.map(Duration::from_millis)).expect("idle");
        bus.run(answered - 1);
        assert_eq!(bus.told.pop(), None, "{timeout:?}");
        bus.run(2);
        assert_eq!(bus.told.pop().map(|(_, told)| told), nobody, "{timeout:?}");
    }
    bus.manager.lss(bus.now, lss::Command::InquireNodeId, Some(Duration::from_secs(60))).expect("idle");
    bus.run(50);
    bus.manager.cancel_lss();
    bus.run(1);
    assert_eq!(bus.told.pop().map(|(_, told)| told), Some(Told::Lss(Err(lss::Failure::Timeout))));
    bus.manager.cancel_lss();
    bus.run(1);
    assert_eq!(bus.told.pop(), None, "there is none");
}

#[test]
fn commands_wait_for_the_port_and_are_refused_when_too_many_do() {
    let mut manager = Manager::<2, 2>::new(config(), [], ms(0));
    manager.start(ms(0));
    for _ in 0..16 {
        assert_eq!(manager.command(ms(1), Command::Stop, None), Ok(()));
    }
    assert_eq!(manager.command(ms(1), Command::Stop, None), Err(Unsent::Full));
    let sent = std::iter::from_fn(|| match manager.poll(ms(2)) {
        Action::Transmit(frame) => Some(frame),
        _ => None,
    });
    assert_eq!(sent.filter(|frame| *frame == Command::Stop.frame(None)).count(), 16);
}

/// A caller whose port is full for a while loses nothing of a block that comes meanwhile.
#[test]
fn what_comes_while_the_port_is_full_is_reported() {
    let mut manager = Manager::<2, 2>::new(config(), [], ms(0));
    manager.start(ms(0));
    while manager.poll(ms(0)) != Action::Idle {}
    let reads = Transfer::Upload { address: Address::new(0x2000, 0), block: true };
    manager.submit(ms(0), node(5), reads).expect("idle");
    let response = |bytes: [u8; 8]| Frame::full(Id::Base(0x585), bytes);
    assert!(matches!(manager.poll(ms(0)), Action::Transmit(_)));
    manager.receive(ms(1), &response([0xC6, 0x00, 0x20, 0, 21, 0, 0, 0]));
    assert!(matches!(manager.poll(ms(1)), Action::Transmit(_)));
    manager.command(ms(1), Command::Start, None).expect("room");
    let mut read = 0;
    for number in [1, 2, 0x83] {
        manager.receive(ms(2), &response([number, 1, 2, 3, 4, 5, 6, 7]));
        while let Some(action) = manager.report(ms(2)) {
            assert!(matches!(action, Action::Sdo(..)), "{action:?}");
            read += 7;
        }
    }
    assert_eq!((read, manager.counters().sdo.repeated), (14, 0), "the last is given at the end");
    assert_eq!(manager.poll(ms(3)), Action::Transmit(Command::Start.frame(None)));
    let acknowledged = Frame::full(Id::Base(0x605), [0xA2, 3, 127, 0, 0, 0, 0, 0]);
    assert_eq!(manager.poll(ms(3)), Action::Transmit(acknowledged));
}

#[test]
fn a_frame_takes_its_time() {
    assert!(Frame::worst_bits(false, 8) <= FRAME.as_micros() as u32 + 5);
}
