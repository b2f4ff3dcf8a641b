//! Settings of CANopen buses, their axes and their nodes.

use puente_canopen::Address;
use puente_drives::cia402::{Mode, Profile};

use super::super::keeper::DOCUMENT;
use super::*;

const DOCUMENT_TEXT: &str = r#"{
    "net": {"slcan_port": 29001, "socketcand_port": 29536},
    "bus": [{"name": "can", "protocol": "canopen", "port": "sim", "net": 3, "sync_us": 1000, "bitrate": 500000}],
    "axis": [
        {"name": "u", "bus": "can", "drive": "cia402", "profile": "lexium23a", "address": 2, "homing": -4},
        {"name": "v", "bus": "can", "drive": "cia402", "address": 3}
    ],
    "node": [
        {"bus": "can", "id": 5, "optional": true},
        {"bus": "can", "id": 2, "vendor": 256, "heartbeat_ms": 100,
         "writes": [["0x6083", 0, "u32", 10000], ["24672", 1, "i16", -2], ["0x2000", 2, "r32", 0.5]]}
    ]
}"#;

fn document() -> Settings {
    read(DOCUMENT_TEXT).expect("a document")
}

#[test]
fn keys_and_what_stands_for_those_that_are_not_given() {
    let settings = document();
    assert_eq!(settings.check(), Ok(()));
    let canopen = Canopen { bitrate: 500_000, net: 3, sync_us: 1000, ..Canopen::default() };
    assert_eq!(settings.buses[0].canopen(), Some(&canopen));
    assert_eq!((canopen.node, canopen.heartbeat_ms, canopen.sdo_timeout_ms), (127, 1000, 500));
    assert_eq!((settings.net.slcan_port, settings.net.socketcand_port), (29_001, 29_536));
    let [u, v] = &settings.axes[..] else { panic!("two axes") };
    let cia402 = Cia402 { profile: &Profile::LEXIUM_23A, homing: Some(-4), ..Cia402::default() };
    assert_eq!((&u.drive, u.address), (&Drive::Cia402(cia402), 2));
    assert_eq!(v.drive, Drive::Cia402(Cia402::default()));
    let [plain, drive] = &settings.nodes[..] else { panic!("two nodes") };
    let can: Name = "can".parse().expect("a name");
    assert_eq!(*plain, Node { optional: true, ..Node::new(can, 5) });
    let write = |index, sub, value| Write { address: Address::new(index, sub), value };
    let expected = [
        write(0x6083, 0, Value::U32(10_000)),
        write(24_672, 1, Value::I16(-2)),
        write(0x2000, 2, Value::R32(0.5)),
    ];
    assert_eq!(drive.writes, expected);
    assert_eq!((drive.vendor, drive.heartbeat_ms, drive.start), (Some(256), Some(100), true));
    // And what it says comes back.
    assert_eq!(read(&text_of(&settings)), Ok(settings.clone()));
    let toml = toml::to_string(&settings).expect("TOML");
    assert_eq!(toml::from_str::<Settings>(&toml).expect("a document"), settings);
    assert!(!text_of(&settings).contains("baud"), "it has no serial line");
}

#[test]
fn a_value_goes_to_the_bus_low_byte_first() {
    for (value, bytes) in [
        (Value::I8(-2), &[0xFE][..]),
        (Value::U16(0x0102), &[2, 1]),
        (Value::I32(-2), &[0xFE, 0xFF, 0xFF, 0xFF]),
        (Value::R32(1.0), &[0, 0, 0x80, 0x3F]),
        (Value::U64(1), &[1, 0, 0, 0, 0, 0, 0, 0]),
    ] {
        let (all, length) = value.bytes();
        assert_eq!(all[..length], *bytes);
    }
}

#[test]
fn what_does_not_hold_is_told() {
    let text = text_of(&document());
    for (good, bad, sentence) in [
        ("500000,\"node\"", "500001,\"node\"", "[[bus]] \"can\" bitrate: 10000, 20000, 50000"),
        ("\"node\":127", "\"node\":0", "[[bus]] \"can\" node: 1 to 127 is allowed"),
        ("\"node\":127", "\"node\":128", "[[bus]] \"can\" node: 1 to 127 is allowed"),
        ("\"sync_us\":1000", "\"sync_us\":499", "[[bus]] \"can\" sync_us: 0 or 500 to"),
        ("\"sync_overflow\":0", "\"sync_overflow\":1", "[[bus]] \"can\" sync_overflow: 0 or 2 to 240"),
        ("\"sdo_timeout_ms\":500", "\"sdo_timeout_ms\":9", "[[bus]] \"can\" sdo_timeout_ms: 10 to"),
        ("\"net\":3", "\"net\":3,\"baud\":9600", "[[bus]] \"can\" baud: this protocol has no such key"),
        ("\"net\":3", "\"net\":3,\"ipg\":2", "[[bus]] \"can\" ipg: this protocol has no such key"),
        ("\"sim\"", "\"/dev/ttyUSB0\"", "[[bus]] \"can\" port: expected \"sim\", \"slcan:"),
        ("\"address\":2", "\"address\":0", "[[axis]] \"u\" address: 1 to 127"),
        ("\"address\":2", "\"address\":128", "[[axis]] \"u\" address: 1 to 127"),
        ("\"address\":2", "\"address\":127", "[[axis]] \"u\" address: it must differ from the node of"),
        ("\"address\":3", "\"address\":2", "[[axis]] \"v\" address: axis \"u\" has this drive"),
        ("\"homing_fast\":null", "\"homing_fast\":0", "[[axis]] \"u\" homing_fast: it must be above 0"),
        ("\"homing\":-4", "\"homing\":0", "[[axis]] \"u\" homing: a method of CiA 402"),
        ("\"cyclic\":null", "\"cyclic\":\"csp\"", "[[axis]] \"u\" cyclic: the profile has no such mode"),
        ("\"homing\":-4", "\"max_rpm\":1", "[[axis]] \"u\" max_rpm: this drive has no such key"),
        ("\"id\":5", "\"id\":0", "[[node]] 0 of \"can\" id: 1 to 127"),
        ("\"id\":5", "\"id\":127", "[[node]] 127 of \"can\" id: it must differ from the node of"),
        ("\"id\":5", "\"id\":2", "[[node]] 2 of \"can\" id: another [[node]] is this one"),
        ("\"can\",\"id\":5", "\"can2\",\"id\":5", "[[node]] 5 of \"can2\" bus: there is no CANopen [[bus]]"),
        (
            "\"guard_ms\":0,\"life_factor\":3,\"start\":true,\"writes\":[[",
            "\"guard_ms\":1,\"writes\":[[",
            "[[node]] 2 of \"can\" guard_ms: a node has a heartbeat or is guarded",
        ),
        ("\"life_factor\":3", "\"life_factor\":1", "[[node]] 5 of \"can\" life_factor: 2 to 255"),
        ("29536", "29001", "[net] socketcand_port: it must differ"),
        ("29001", "8502", "[net] slcan_port: it must differ"),
        ("\"drive\":\"cia402\"", "\"drive\":\"edb\"", "[[axis]] \"u\" "),
    ] {
        assert!(text.contains(good), "{good} is not in {text}");
        let problem = read(&text.replacen(good, bad, 1)).expect("a document").check().expect_err(bad);
        assert!(problem.to_string().starts_with(sentence), "{bad}: {problem}");
    }
    for (good, bad) in [
        ("lexium23a", "lexium"),
        ("\"cyclic\":null", "\"cyclic\":\"pp\""),
        ("\"cyclic\":null", "\"cyclic\":\"csv\""),
        ("\"cyclic\":null", "\"cyclic\":7"),
        ("\"0x6083\"", "\"6083h\""),
        ("\"0x6083\"", "24707"),
        ("\"u32\"", "\"u33\""),
        (",10000]", "]"),
        (",10000]", ",10000,1]"),
        (",10000]", ",-1]"),
        (",10000]", ",4294967296]"),
        ("\"optional\"", "\"option\""),
    ] {
        assert!(text.contains(good), "{good} is not in {text}");
        assert!(read(&text.replacen(good, bad, 1)).is_err(), "{bad}");
    }
}

#[test]
fn two_buses_have_two_numbers() {
    let mut settings = document();
    let mut second = settings.buses[0].clone();
    second.name = "two".parse().expect("a name");
    settings.buses.push(second).expect("room");
    let problem = settings.check().expect_err("the same number");
    assert_eq!(problem.to_string(), "[[bus]] \"two\" net: bus \"can\" has number 3 already");
    if let Protocol::Canopen(canopen) = &mut settings.buses[1].protocol {
        canopen.net = 4;
    }
    assert_eq!(settings.check(), Ok(()));
}

/// A document without a CANopen bus is as it was; the rest of one with is after what older firmware reads, which refuses it.
#[test]
fn the_compact_form_of_a_canopen_bus() {
    let mut settings = document();
    settings.net = Settings::factory().net;
    settings.net.slcan_port = 1;
    settings.nodes[1].writes.truncate(2);
    let mut bytes = [0; 512];
    let length = record::emit(&mut bytes, Some(&settings), None).expect("room");
    let expected: &[&[u8]] = &[
        b"pS\x01\0\0\0\0\0\xA1\0",
        &[1, 127, 0, 0, 1, 0x90, 0x3F, 0xB6, 0x42, 16, 0xFA, 0x01, 120, 1],
        b"\x10192.168.1.111/24\0\x06puente",
        // One bus.
        b"\x01\x03can\x03\x03sim\xA0\xC2\x1E\x7F\x03\xE8\x07\0\xE8\x07\xF4\x03\0",
        // Two axes.
        b"\x02\x01u\x03can\x02\x02\x09lexium23a\x01\xFC\0\0\0\0",
        b"\x01v\x03can\x02\x03\x07generic\0\0\0\0\0",
        // Ports, and two nodes.
        b"\x01\0\x02\x03can\x05\0\x01\0\0\0\0\0\0\0\x03\x01\0",
        b"\x03can\x02\0\0\x01\x80\x02\0\0\0\0\x01\x64\0\x03\x01",
        b"\x02\x83\xC1\x01\0\x06\x90\x4E\xE0\xC0\x01\x01\x01\x03",
    ];
    assert_eq!(bytes[..length].escape_ascii().to_string(), expected.concat().escape_ascii().to_string());
}

/// Of an axis.
fn cyclic(settings: &mut Settings, axis: usize) -> &mut Option<Mode> {
    match &mut settings.axes[axis].drive {
        Drive::Cia402(cia402) => &mut cia402.cyclic,
        _ => panic!("a drive of CiA 402"),
    }
}

#[test]
fn a_cyclic_mode_needs_a_sync_that_can_be_said() {
    let text = DOCUMENT_TEXT.replace("\"address\": 3", "\"address\": 3, \"cyclic\": \"csp\"");
    let mut settings = read(&text).expect("a document");
    assert_eq!(*cyclic(&mut settings, 1), Some(Mode::CyclicPosition));
    *cyclic(&mut settings, 0) = Some(Mode::InterpolatedPosition);
    for (sync_us, problem) in [
        (1_000, None),
        (25_500, None),
        (0, Some("[[axis]] \"u\" cyclic: the bus needs a sync_us above 0 for it")),
        (
            25_600,
            Some("[[axis]] \"u\" cyclic: sync_us of the bus must be 1 to 255 times a power of ten for it"),
        ),
    ] {
        if let Protocol::Canopen(canopen) = &mut settings.buses[0].protocol {
            canopen.sync_us = sync_us;
        }
        let found = settings.check().err().map(|problem| problem.to_string());
        assert_eq!(found.as_deref(), problem, "{sync_us}");
    }
    let text = text_of(&document()).replace("\"drive\":\"cia402\"", "\"drive\":\"edb\"");
    let problem = read(&text).expect("a document").check().expect_err("of another drive");
    assert!(problem.to_string().starts_with("[[axis]] \"u\" "), "{problem}");
}

/// The modes come last, and only where there are some: firmware that does not know them refuses such a document.
#[test]
fn the_compact_form_of_cyclic_modes() {
    let mut settings = document();
    settings.net = Settings::factory().net;
    settings.nodes.clear();
    let mut bytes = [0; 512];
    let before = record::emit(&mut bytes, Some(&settings), None).expect("room");
    let without = bytes[10..before].to_vec();
    *cyclic(&mut settings, 1) = Some(Mode::CyclicPosition);
    let length = record::emit(&mut bytes, Some(&settings), None).expect("room");
    // No ports, no nodes; two axes.
    let expected = [&without[..], b"\0\0\0", b"\x02\0\x08"].concat();
    assert_eq!(bytes[10..length].escape_ascii().to_string(), expected.escape_ascii().to_string());
    let read = |bytes: &[u8]| {
        let mut found = Settings::factory();
        let read = Record::parse(bytes).expect("a record").confirmed(&mut found);
        read.map(|_| found)
    };
    assert_eq!(read(&bytes[..length]), Ok(settings));
    // A mode that no move is made in, of an axis that there is not, and one too many.
    for (place, value) in [(length - 1, 9), (length - 1, 0xFF), (length - 3, 3)] {
        let mut other = bytes[..length].to_vec();
        other[place] = value;
        assert_eq!(read(&other), Err(record::Unreadable), "{value} at {place}");
    }
}

prop_compose! {
    fn any_write()(index: u16, sub: u8, kind in 0..6_u8, bits: u64) -> Write {
        let value = match kind {
            0 => Value::I8(bits as i8),
            1 => Value::U16(bits as u16),
            2 => Value::I32(bits as i32),
            3 => Value::I64(bits as i64),
            4 => Value::R32((bits as f32) / 3.0),
            _ => Value::R64((bits as f64) * 1e-30),
        };
        Write { address: Address::new(index, sub), value }
    }
}

prop_compose! {
    fn any_node()(
        id in 10..=120_u8,
        optional: bool,
        start: bool,
        words in proptest::array::uniform5(proptest::option::of(any::<u32>())),
        heartbeat_ms in proptest::option::of(any::<u16>()),
        guard_ms: u16,
        life_factor in 2..=255_u8,
        writes in proptest::collection::vec(any_write(), 0..8),
    ) -> Node {
        let [vendor, product, revision, serial, device_type] = words;
        let guard_ms = if heartbeat_ms.is_some_and(|ms| ms > 0) { 0 } else { guard_ms };
        let writes = writes.into_iter().collect();
        let bus = "can".parse().expect("a name");
        Node {
            optional, vendor, product, revision, serial, device_type, heartbeat_ms, guard_ms, life_factor, start, writes,
            ..Node::new(bus, id)
        }
    }
}

proptest! {
    #[test]
    fn every_form_gives_the_same_nodes_back(
        nodes in proptest::collection::vec(any_node(), 0..8),
        ports in (0..3_u16, 10..12_u16),
        modes in proptest::array::uniform2(0..3_usize),
    ) {
        let mut settings = document();
        (settings.net.slcan_port, settings.net.socketcand_port) = ports;
        let known = [None, Some(Mode::InterpolatedPosition), Some(Mode::CyclicPosition)];
        // The first axis has no CSP.
        *cyclic(&mut settings, 0) = known[modes[0] % 2];
        *cyclic(&mut settings, 1) = known[modes[1]];
        settings.nodes.clear();
        for node in nodes {
            if settings.nodes.iter().all(|other| other.id != node.id) {
                settings.nodes.push(node).expect("room");
            }
        }
        prop_assert_eq!(settings.check(), Ok(()));
        prop_assert_eq!(read(&text_of(&settings)), Ok(settings.clone()));
        let toml = toml::to_string(&settings).expect("TOML");
        prop_assert_eq!(toml::from_str::<Settings>(&toml).expect("a document"), settings.clone());
        let mut bytes = [0; DOCUMENT];
        let length = record::emit(&mut bytes, Some(&settings), Some(Some(&settings))).expect("room");
        let record = Record::parse(&bytes[..length]).expect("a record");
        for tried in [false, true] {
            let mut found = Settings::factory();
            let read = if tried { record.tried(&mut found) } else { record.confirmed(&mut found) };
            prop_assert_eq!(read, Ok(true));
            prop_assert_eq!(&found, &settings);
        }
    }
}
