//! Nodes that have booted: judged, configured, supervised and started.

mod common;

use std::collections::BTreeMap;

use common::channel::Channel;
use common::server::{Habits, Server};
use proptest::prelude::*;
use puente_canopen::boot::{Boot, Plan, Signs, Step, Verdict};
use puente_canopen::dcf::{self, BadDcf, Entry, Full, List};
use puente_canopen::lss::{Known, Part};
use puente_canopen::nmt::Command;
use puente_canopen::sdo::{Abort, Config, Failure, Transfer};
use puente_canopen::{Address, object};

/// RPDO1 and TPDO1 of node 2 are switched on (001, 6.4.1).
fn thesis() -> heapless::Vec<u8, 64> {
    let mut list = heapless::Vec::new();
    for (index, value) in [(0x1400, 0x4000_0202_u32), (0x1800, 0x4000_0182)] {
        let entry = Entry { address: Address::new(index, 1), data: &value.to_le_bytes() };
        dcf::push(&mut list, entry).expect("room");
    }
    list
}

fn plan(list: &[u8]) -> Plan<'_> {
    Plan {
        device_type: Some(0x0002_0192),
        identity: Known { vendor: Some(0x80), serial: Some(7), ..Known::default() },
        configuration: List::parse(list).expect("a list"),
        wishes: List::EMPTY,
        signs: Signs::Heartbeat(100),
        starts: true,
    }
}

fn node() -> Channel<Server> {
    let mut channel = Channel::with_server(Habits::default(), Config::DEFAULT, b"");
    let objects: [(u16, u8, &[u8]); 10] = [
        (0x1000, 0, &[0x92, 0x01, 0x02, 0x00]),
        (0x1018, 1, &[0x80, 0, 0, 0]),
        (0x1018, 2, &[9, 0, 0, 0]),
        (0x1018, 3, &[1, 0, 0, 0]),
        (0x1018, 4, &[7, 0, 0, 0]),
        (0x1400, 1, &[0; 4]),
        (0x1800, 1, &[0; 4]),
        (0x1017, 0, &[0; 2]),
        (0x100C, 0, &[0; 2]),
        (0x100D, 0, &[0]),
    ];
    channel.far.objects =
        objects.into_iter().map(|(index, sub, data)| ((index, sub), data.to_vec())).collect();
    channel
}

/// Boots; what was commanded.
fn boot(plan: Plan<'_>, channel: &mut Channel<Server>) -> Result<Vec<Command>, Verdict> {
    let mut boot = Boot::new(plan);
    let mut commands = Vec::new();
    for _ in 0..20 {
        let mut none = |_| false;
        match boot.step() {
            Step::Read(address) => {
                let (end, read) = channel.run(Transfer::Upload { address, block: false }, &[], &mut none);
                boot.done(end.map(|_| &read[..]))?;
            }
            Step::Write { address, value } => {
                let mut buffer = [0; 2];
                let data = value.bytes(&mut buffer);
                let write = Transfer::Download { address, size: data.len() as u32, block: false };
                let (end, _) = channel.run(write, data, &mut none);
                boot.done(end.map(|_| &[][..]))?;
            }
            Step::Command(command) => {
                commands.push(command);
                boot.done(Ok(&[]))?;
            }
            Step::Done => return Ok(commands),
        }
    }
    panic!("it does not end");
}

#[test]
fn the_right_node_is_configured_and_started() {
    let list = thesis();
    let mut channel = node();
    assert_eq!(boot(plan(&list), &mut channel), Ok(vec![Command::Start]));
    let written: Vec<_> =
        channel.far.written.iter().map(|((index, _), data)| (*index, data.clone())).collect();
    let expected = [
        (0x1400, vec![0x02, 0x02, 0x00, 0x40]),
        (0x1800, vec![0x82, 0x01, 0x00, 0x40]),
        (0x1017, vec![100, 0]),
    ];
    assert_eq!(written, expected);
    // Nothing is asked for, nothing is done.
    let nothing = Plan {
        device_type: None,
        identity: Known::default(),
        configuration: List::default(),
        wishes: List::EMPTY,
        signs: Signs::Unchanged,
        starts: false,
    };
    assert_eq!(Boot::new(nothing).step(), Step::Done);
}

#[test]
fn a_wrong_node_is_left_alone() {
    let list = thesis();
    let verdict = |plan: Plan<'_>| {
        let mut channel = node();
        let end = boot(plan, &mut channel);
        assert_eq!(channel.far.written, []);
        end.expect_err("a verdict")
    };
    let other = Plan { device_type: Some(0x191), ..plan(&list) };
    assert_eq!(verdict(other), Verdict::DeviceType { expected: 0x191, received: 0x0002_0192 });
    let other = Plan { identity: Known { serial: Some(8), ..Known::default() }, ..plan(&list) };
    let expected = Verdict::Identity { part: Part::Serial, expected: 8, received: 7 };
    assert_eq!(verdict(other), expected);
    assert_eq!(expected.to_string(), "serial number 00000007h instead of 00000008h");
}

#[test]
fn what_cannot_be_read_or_written_is_told() {
    let list = thesis();
    let mut channel = node();
    channel.far.objects.remove(&(0x1800, 1));
    let failure = Failure::Aborted(Abort::NO_OBJECT);
    let expected = Verdict::Failed { address: Address::new(0x1800, 1), failure };
    assert_eq!(boot(plan(&list), &mut channel), Err(expected));
    assert_eq!(expected.to_string(), "1800h:1: the node refused: 0x06020000 object does not exist");
    let mut channel = node();
    channel.far.objects.insert((0x1018, 1), vec![0x80, 0]);
    assert_eq!(boot(plan(&list), &mut channel), Err(Verdict::Size { address: object::VENDOR, received: 2 }));
}

#[test]
fn a_node_without_heartbeat_is_guarded() {
    let guarded = |heartbeat: bool| {
        let list = thesis();
        let mut channel = node();
        if !heartbeat {
            channel.far.objects.remove(&(0x1017, 0));
        }
        let plan = Plan { signs: Signs::Guarding { time: 200, factor: 3 }, ..plan(&list) };
        assert_eq!(boot(plan, &mut channel), Ok(vec![Command::Start]));
        let written: BTreeMap<_, _> = channel.far.written.into_iter().collect();
        assert_eq!((&written[&(0x100C, 0)][..], &written[&(0x100D, 0)][..]), (&[200, 0][..], &[3][..]));
        assert_eq!(written.contains_key(&(0x1017, 0)), heartbeat);
    };
    guarded(true);
    guarded(false);
    // But silence is no refusal.
    let mut boot = Boot::new(Plan {
        device_type: None,
        identity: Known::default(),
        configuration: List::default(),
        wishes: List::EMPTY,
        signs: Signs::Guarding { time: 200, factor: 3 },
        starts: false,
    });
    let failure = Failure::Timeout { heard: None };
    assert_eq!(boot.done(Err(failure)), Err(Verdict::Failed { address: object::HEARTBEAT_TIME, failure }));
}

#[test]
fn lists_byte_by_byte() {
    let list = thesis();
    let expected = [
        2, 0, 0, 0, 0x00, 0x14, 1, 4, 0, 0, 0, 0x02, 0x02, 0x00, 0x40, 0x00, 0x18, 1, 4, 0, 0, 0, 0x82, 0x01,
        0, 0x40,
    ];
    assert_eq!(list, expected);
    assert_eq!(List::parse(&list).map(|list| list.entries().count()), Ok(2));
    assert_eq!(List::parse(&list[..25]), Err(BadDcf::TooShort { entry: 1 }));
    assert_eq!(List::parse(&list[..3]), Err(BadDcf::TooShort { entry: 0 }));
    assert_eq!(List::parse(&[&list[..], &[0]].concat()), Err(BadDcf::TooLong { left: 1 }));
    let empty = [1, 0, 0, 0, 0, 0x20, 3, 0, 0, 0, 0];
    assert_eq!(List::parse(&empty), Err(BadDcf::Empty { address: Address::new(0x2000, 3) }));
    let mut small = heapless::Vec::<u8, 11>::new();
    let address = Address::new(0x2000, 0);
    assert_eq!(dcf::push(&mut small, Entry { address, data: &[1] }), Err(Full));
    assert_eq!(small, []);
    assert_eq!(dcf::push(&mut heapless::Vec::<u8, 64>::new(), Entry { address, data: &[] }), Err(Full));
}

proptest! {
    #[test]
    fn lists_are_made_as_they_are_taken(
        entries in prop::collection::vec((any::<u16>(), any::<u8>(), prop::collection::vec(any::<u8>(), 1..9)), 0..9),
    ) {
        let mut list = heapless::Vec::<u8, 256>::new();
        let entries = entries.iter().map(|(index, sub, data)| Entry { address: Address::new(*index, *sub), data });
        let entries: Vec<_> = entries.collect();
        for entry in &entries {
            prop_assert_eq!(dcf::push(&mut list, *entry), Ok(()));
        }
        if !entries.is_empty() {
            let parsed = List::parse(&list).expect("a list");
            prop_assert_eq!(parsed.entries().collect::<Vec<_>>(), entries);
        }
    }

    #[test]
    fn any_bytes(bytes in prop::collection::vec(prop_oneof![3 => 0..4_u8, 1 => any::<u8>()], 0..80)) {
        if let Ok(list) = List::parse(&bytes) {
            let count = u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            prop_assert_eq!(list.entries().count(), count as usize);
            prop_assert!(list.entries().all(|entry| !entry.data.is_empty()));
        }
    }
}
