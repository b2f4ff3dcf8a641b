//! Frames built by hand, and what comes of any frame.

mod common;

use common::{any_frame, data, frame, ms};
use proptest::prelude::*;
use puente_canopen::cob::{self, Function};
use puente_canopen::emcy::{self, Emergency, History, Register};
use puente_canopen::nmt::{Command, Sign, State};
use puente_canopen::sync::{self, Overflow};
use puente_canopen::time::{self, TimeOfDay};
use puente_canopen::{Address, Frame, Id, NodeId, heartbeat};
use puente_line::{Duration, Instant};

fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("a node-ID")
}

#[test]
fn commands_have_the_bytes_of_the_thesis() {
    // 001, 6.4.1: "0, 2, 81 - 02" and so on.
    let told = [
        (Command::ResetNode, "81 02"),
        (Command::ResetCommunication, "82 02"),
        (Command::EnterPreOperational, "80 02"),
        (Command::Start, "01 02"),
        (Command::Stop, "02 02"),
    ];
    for (command, bytes) in told {
        let made = command.frame(Some(node(2)));
        assert_eq!(made, frame(0, bytes));
        assert_eq!(Command::parse(&made), Some((command, Some(node(2)))));
    }
    assert_eq!(Command::Start.frame(None), frame(0, "01 00"));
    assert_eq!(Command::parse(&frame(0, "01 00")), Some((Command::Start, None)));
    for wrong in ["01", "01 80", "03 01", "01 01 00"] {
        assert_eq!(Command::parse(&frame(0, wrong)), None, "{wrong}");
    }
    assert_eq!(Command::parse(&frame(1, "01 00")), None);
}

#[test]
fn signs_of_life() {
    let sign = |state, toggle| Some(Sign { node: node(2), state, toggle });
    // SEED4: guarding answers 04/84, 7F/FF, 05/85.
    assert_eq!(Sign::parse(&frame(0x702, "00")), sign(State::BootUp, false));
    assert_eq!(Sign::parse(&frame(0x702, "84")), sign(State::Stopped, true));
    assert_eq!(Sign::parse(&frame(0x702, "FF")), sign(State::PreOperational, true));
    assert_eq!(Sign::parse(&frame(0x702, "05")), sign(State::Operational, false));
    // 001, 6.4.1 prints "702, 1, 40", which is no state.
    for wrong in ["40", "", "05 00", "01"] {
        assert_eq!(Sign::parse(&frame(0x702, wrong)), None, "{wrong}");
    }
    let asked = Sign::request(node(2));
    assert_eq!((asked.id(), asked.is_remote(), asked.data()), (Id::Base(0x702), true, &[][..]));
    assert_eq!(Sign::parse(&asked), None);
}

#[test]
fn cob_ids_of_the_connection_set() {
    let cases = [
        (0x000, Some(Function::Nmt)),
        (0x080, Some(Function::Sync)),
        (0x082, Some(Function::Emcy(node(2)))),
        (0x100, Some(Function::Time)),
        (0x182, Some(Function::Tpdo(1, node(2)))),
        (0x202, Some(Function::Rpdo(1, node(2)))),
        (0x4FF, Some(Function::Tpdo(4, node(127)))),
        (0x57F, Some(Function::Rpdo(4, node(127)))),
        (0x582, Some(Function::SdoResponse(node(2)))),
        (0x602, Some(Function::SdoRequest(node(2)))),
        (0x701, Some(Function::ErrorControl(node(1)))),
        (0x7E4, Some(Function::LssSlave)),
        (0x7E5, Some(Function::LssMaster)),
        (0x180, None),
        (0x001, None),
        (0x101, None),
        (0x680, None),
        (0x700, None),
        (0x7E6, None),
    ];
    for (id, function) in cases {
        assert_eq!(Function::of(Id::Base(id)), function, "{id:03X}");
    }
    assert_eq!(Function::of(Id::Extended(0x80)), None);
    for node in NodeId::all() {
        let mine = [node.emcy(), node.sdo_request(), node.sdo_response(), node.error_control()];
        let pdos = (1..=4).flat_map(|number| [node.tpdo(number), node.rpdo(number)]).flatten();
        let all: std::collections::BTreeSet<_> = mine.into_iter().chain(pdos).collect();
        assert_eq!(all.len(), 12);
    }
    assert_eq!((node(2).tpdo(0), node(2).tpdo(5), node(2).rpdo(5)), (None, None, None));
    let restricted = (0..=0x7FF).filter(|id| cob::is_restricted(*id)).count();
    // 7.3.5, each range counted by hand: 80h, 80h, 7Fh, 7Fh, 20h, 7Fh, 80h.
    assert_eq!(restricted, 3 * 0x80 + 3 * 0x7F + 0x20);
}

#[test]
fn time_of_day() {
    let time = TimeOfDay::from_unix_millis(1_704_067_201_000).expect("2024-01-01 00:00:01");
    assert_eq!(time.frame(cob::TIME), frame(0x100, "E8 03 00 00 12 39"));
    assert_eq!(
        TimeOfDay::parse(cob::TIME, &frame(0x100, "E8 03 00 F0 12 39")),
        Some(time),
        "4 bits are nothing"
    );
    assert_eq!(time.to_unix_millis(), 1_704_067_201_000);
    assert_eq!(TimeOfDay::from_unix_millis(0), None);
    assert_eq!(TimeOfDay::new(0, 86_400_000), None);
    assert_eq!(TimeOfDay::parse(cob::TIME, &frame(0x100, "00 5C 26 05 00 00")), None, "24 hours");
    let first = TimeOfDay::from_unix_millis(441_763_200_000).expect("1984-01-01");
    assert_eq!((first.days(), first.millis()), (0, 0));

    let mut producer = time::Producer::new(cob::TIME, Duration::from_secs(1));
    producer.start(ms(10));
    assert_eq!(producer.poll(ms(9), Some(time)), None);
    assert_eq!(producer.poll(ms(10), None), None, "nobody knows the time");
    assert_eq!(producer.poll_at(), Some(ms(1_010)));
    assert_eq!(producer.poll(ms(1_010), Some(time)), Some(time.frame(cob::TIME)));
    producer.stop();
    assert_eq!(producer.poll_at(), None);
}

#[test]
fn sync_counts_and_keeps_its_grid() {
    assert_eq!(
        [0, 1, 2, 240, 241, 255].map(|last| Overflow::new(last).is_some()),
        [false, false, true, true, false, false]
    );
    let mut producer = sync::Producer::new(cob::SYNC, Duration::from_millis(1), Overflow::new(3));
    assert_eq!((producer.poll(ms(5)), producer.poll_at()), (None, None));
    producer.start(ms(10));
    let mut counts = Vec::new();
    for at in 10..18 {
        // Always late by a part of the period.
        let made = producer.poll(Instant::from_micros(at * 1_000 + 400)).expect("due");
        counts.push(sync::parse(cob::SYNC, &made).expect("SYNC").expect("a counter"));
        assert_eq!(producer.poll_at(), Some(ms(at + 1)));
    }
    assert_eq!(counts, [1, 2, 3, 1, 2, 3, 1, 2]);
    assert_eq!(producer.missed(), 0);
    assert!(producer.poll(Instant::from_micros(21_500)).is_some(), "18, 19 and 20 have passed");
    assert_eq!((producer.missed(), producer.poll_at()), (3, Some(ms(22))));
    producer.start(ms(30));
    assert_eq!(producer.poll(ms(30)).map(|made| data(&made)), Some(vec![1]), "starts over");
    assert_eq!(sync::Producer::plain(Duration::ZERO).poll_at(), None);
    let mut plain = sync::Producer::plain(Duration::from_millis(1));
    plain.start(ms(1));
    assert_eq!(plain.poll(ms(1)), Some(frame(0x80, "")));
    assert_eq!(sync::parse(0x80, &frame(0x80, "")), Some(None));
    assert_eq!(sync::parse(0x80, &frame(0x80, "00")), None);
}

#[test]
fn the_managers_own_heartbeat() {
    let mut producer = heartbeat::Producer::new(node(127), Duration::from_millis(100));
    assert_eq!(producer.poll_at(), Some(Instant::ZERO));
    assert_eq!(producer.poll(ms(5)), Some(frame(0x77F, "00")));
    assert_eq!((producer.poll(ms(5)), producer.poll_at()), (None, Some(ms(105))));
    assert_eq!(producer.poll(ms(105)), Some(frame(0x77F, "7F")));
    producer.set_state(State::Operational);
    assert_eq!(producer.poll(ms(205)), Some(frame(0x77F, "05")));
}

#[test]
fn emergencies_and_their_history() {
    // Festo CMMP: DC-link over-voltage.
    let over = Emergency { code: 0x3210, register: 0x05, vendor: [7, 0, 0, 0, 0] };
    let made = over.frame(node(3));
    assert_eq!(made, frame(0x83, "10 32 05 07 00 00 00 00"));
    assert_eq!(Emergency::parse(&made), Some((node(3), over)));
    assert_eq!(over.to_string(), "3210h voltage inside");
    assert_eq!(Register(over.register).names().collect::<Vec<_>>(), ["generic", "voltage"]);
    assert_eq!(Emergency::parse(&frame(0x83, "10 32 05 07")), Some((node(3), over)), "short ones are filled");
    assert_eq!(Emergency::parse(&frame(0x83, "10 32")), None);
    assert_eq!(Emergency::parse(&frame(0x80, "")), None, "SYNC");

    let mut history = History::<2>::new();
    let reset = |register| Emergency { code: 0, register, vendor: [0; 5] };
    history.push(ms(1), over);
    history.push(ms(2), reset(0x01));
    assert_eq!(history.pending(), Some(over), "something is left");
    history.push(ms(3), reset(0));
    assert_eq!((history.pending(), history.count()), (None, 3));
    let times: Vec<_> = history.entries().map(|(at, _)| *at).collect();
    assert_eq!(times, [ms(2), ms(3)]);
    history.push(ms(4), over);
    history.boot();
    assert_eq!(history.pending(), None);
}

#[test]
fn codes_are_described_by_class_and_detail() {
    let cases = [
        (0x0000, "no error"),
        (0x8130, "guarding or heartbeat missing"),
        (0x8611, "monitoring"),
        (0x2310, "current, output side"),
        (0x7121, "additional modules"),
        (0xFF01, "device specific"),
        (0xA000, "reserved"),
    ];
    for (code, text) in cases {
        assert_eq!(emcy::describe(code), text, "{code:04X}");
    }
}

#[test]
fn lengths_on_the_wire() {
    // 47 bits of a base frame without data, 67 of an extended one, and what is stuffed in.
    assert_eq!(Frame::worst_bits(false, 8), 135);
    assert_eq!(Frame::worst_bits(true, 8), 160);
    assert_eq!(Address::new(0x607A, 0).to_bytes(), [0x7A, 0x60, 0]);
    assert_eq!(Address::new(0x1018, 4).to_string(), "1018h:4");
}

proptest! {
    #[test]
    fn no_frame_disturbs(frame in any_frame()) {
        let least = if matches!(frame.id(), Id::Base(_)) { 47 } else { 67 };
        let extended = matches!(frame.id(), Id::Extended(_));
        let bytes = frame.data().len() as u8;
        prop_assert!(frame.bits() >= least + 8 * u32::from(bytes));
        prop_assert!(frame.bits() <= Frame::worst_bits(extended, bytes));
        if let Some((command, to)) = Command::parse(&frame) {
            prop_assert_eq!(command.frame(to), frame);
        }
        if let Some(sign) = Sign::parse(&frame) {
            prop_assert_eq!(sign.frame(), frame);
        }
        if let Some((from, emergency)) = Emergency::parse(&frame) {
            prop_assert!(emergency.frame(from).data().starts_with(frame.data()));
        }
        if let Some(time) = TimeOfDay::parse(cob::TIME, &frame) {
            prop_assert_eq!(TimeOfDay::parse(cob::TIME, &time.frame(cob::TIME)), Some(time));
        }
        if let Some(count) = sync::parse(cob::SYNC, &frame) {
            prop_assert_eq!(frame.data(), count.as_slice());
        }
    }

    #[test]
    fn any_time_is_told(millis in 441_763_200_000..6_104_073_600_000_u64) {
        let time = TimeOfDay::from_unix_millis(millis).expect("within its range");
        prop_assert_eq!(time.to_unix_millis(), millis);
        prop_assert_eq!(TimeOfDay::from_bytes(time.to_bytes()), Some(time));
    }
}
