use puente_canopen::Address;
use puente_drives::cia402::{Mode, Profile};

use super::super::{
    Canopen, Cia402, Cidr, ClientFrames, Drive, Echo, Edb, Framed, Modbus, Node, Payload, Pid, Policy,
    Protocol, Value, Write,
};
use super::*;

/// The text that a reply has for it.
fn json(value: &impl serde::Serialize) -> std::string::String {
    serde_json::to_string(value).expect("text")
}

/// The largest document that holds.
fn largest() -> Settings {
    let mut settings = Settings::factory();
    let net = &mut settings.net;
    net.bind = [255; 4].into();
    (net.port, net.modbus_port) = (65_535, 65_534);
    (net.slcan_port, net.socketcand_port) = (65_533, 65_532);
    (net.lease_ms, net.idle_s, net.dhcp) = (5000, 86_400, false);
    net.address = Cidr { address: [223, 255, 255, 253].into(), prefix: 30 };
    net.router = Some([223, 255, 255, 254].into());
    net.hostname = "h".repeat(32).parse().expect("a name");
    // As many commas as a text of 128 characters has.
    let units: std::vec::Vec<_> = (0..36).map(|number| (100 + 2 * number).to_string()).collect();
    let bus = &mut settings.buses[0];
    bus.name = "b".repeat(16).parse().expect("a name");
    bus.port = ("/".to_string() + &"p".repeat(63)).parse().expect("a port");
    bus.protocol = Protocol::ModbusAscii(Modbus {
        line: puente_line::Settings { baud: 1_000_000, ..Modbus::default().line },
        units: units[..32].join(",").parse().expect("units"),
        reply_timeout_ms: 60_000,
        turnaround_ms: 10_000,
        rest_ms: 10_000,
        quarantine_ms: Some(60_000),
        queue_timeout_ms: 60_000,
        echo: Echo::Verify,
    });
    let mut axis = settings.axes[0].clone();
    (axis.name, axis.bus) = ("a".repeat(16).parse().expect("a name"), bus.name.clone());
    axis.address = 247;
    let mut edb = Edb { max_rpm: 32_767, ..Edb::default() };
    let registers = &mut edb.registers;
    for (number, register) in [
        &mut registers.status,
        &mut registers.speed_feedback,
        &mut registers.alarm,
        &mut registers.alarm_history,
        &mut registers.jog_speed,
        &mut registers.clear_alarm,
        &mut registers.jog_enable,
        &mut registers.jog_forward,
        &mut registers.jog_reverse,
    ]
    .into_iter()
    .enumerate()
    {
        *register = 60_000 + number as u16;
    }
    axis.drive = Drive::Edb(edb);
    settings.axes = core::iter::once(axis).collect();
    assert_eq!(settings.check(), Ok(()));
    settings
}

/// The largest document with a framed bus.
fn largest_framed() -> Settings {
    let mut settings = largest();
    let framed = Framed {
        line: Framed::default().line,
        station: 254,
        policy: Policy::Truncated,
        cycle_ms: 1000,
        ipg: 1000,
        slot: 1000,
        attempts: 16,
        window: 8,
        echo: Echo::Verify,
    };
    settings.buses[0].protocol = Protocol::Framed(framed);
    // The longest that ryu writes.
    let gains = Some([1.234_567_9e-30; 3]);
    settings.axes[0].drive = Drive::Pid(Pid { payload: Payload::Binary, gains });
    assert_eq!(settings.check(), Ok(()));
    settings
}

/// The largest document with a CANopen bus and a node.
fn largest_canopen() -> Settings {
    let mut settings = largest();
    let bus = &mut settings.buses[0];
    bus.protocol = Protocol::Canopen(Canopen {
        bitrate: 1_000_000,
        node: 127,
        net: u16::MAX,
        sync_us: 60_000_000,
        sync_overflow: 240,
        heartbeat_ms: u16::MAX,
        sdo_timeout_ms: 60_000,
        client_frames: ClientFrames::Write,
    });
    bus.port = ("slcan:/".to_string() + &"p".repeat(57)).parse().expect("a port");
    let axis = &mut settings.axes[0];
    axis.address = 126;
    axis.drive = Drive::Cia402(Cia402 {
        profile: &Profile::FESTO_CMMS,
        homing: Some(-128),
        homing_fast: Some(u32::MAX),
        homing_slow: Some(u32::MAX),
        homing_acceleration: Some(u32::MAX),
        max_velocity: Some(u32::MAX),
        cyclic: Some(Mode::InterpolatedPosition),
    });
    let longest =
        Write { address: Address::new(u16::MAX, 255), value: Value::R64(-1.234_567_890_123_456_7e-308) };
    let node = Node {
        name: Some("n".repeat(16).parse().expect("a name")),
        vendor: Some(u32::MAX),
        product: Some(u32::MAX),
        revision: Some(u32::MAX),
        serial: Some(u32::MAX),
        device_type: Some(u32::MAX),
        heartbeat_ms: Some(0),
        guard_ms: u16::MAX,
        life_factor: 255,
        start: false,
        writes: [longest; 2].into_iter().collect(),
        ..Node::new(settings.buses[0].name.clone(), 125)
    };
    settings.nodes.push(node).expect("room");
    assert_eq!(settings.check(), Ok(()));
    settings
}

/// Of the parts that [`DOCUMENT`] and two such documents in a record are made of: version and net, a bus, an axis.
#[test]
fn the_form_has_room_for_the_largest_document_and_for_a_record_of_two() {
    let settings = largest();
    let bus = json(&settings.buses[0]).len();
    let axis = json(&settings.axes[0]).len();
    // A comma follows all but the last of each.
    let net = json(&settings).len() - bus - axis;
    println!("{net} {bus} {axis}");
    assert!(net <= 384 && bus < 448 && axis < 288);
    let compact = |settings: &Settings| record::emit(&mut [0; 2048], Some(settings), None).expect("room");
    // A CANopen bus and its axes take less; and a node with two values.
    let canopen = largest_canopen();
    let node = json(&canopen.nodes[0]).len();
    println!("{node}");
    assert!(json(&canopen.buses[0]).len() < 304 && json(&canopen.axes[0]).len() < axis);
    let can_bus = {
        let without = compact(&canopen);
        let mut more = canopen.clone();
        more.buses.push(canopen.buses[0].clone()).expect("room");
        compact(&more) - without
    };
    assert!(node < 304 + 2 * 48, "{node}");
    // A framed bus and its axes take less, in either form.
    let framed = largest_framed();
    assert!(json(&framed.buses[0]).len() < bus && json(&framed.axes[0]).len() < axis);
    assert!(compact(&framed) < compact(&settings));

    let mut more = settings.clone();
    more.buses.push(settings.buses[0].clone()).expect("room");
    let bus = compact(&more) - compact(&settings);
    more = settings.clone();
    more.axes.push(settings.axes[0].clone()).expect("room");
    let axis = compact(&more) - compact(&settings);
    let rest = compact(&settings) - bus - axis;
    let mut canopen = canopen;
    let node = |settings: &mut Settings, writes: usize| {
        let with = compact(settings);
        let longest = settings.nodes[0].writes[0];
        settings.nodes[0].writes.extend(vec![longest; writes - 2]);
        let more = compact(settings) - with;
        let mut none = settings.clone();
        none.nodes.clear();
        more + with - compact(&none)
    };
    println!("{rest} {bus} {axis}");
    // On a board and here.
    for (lines, cans, axes, nodes, writes) in [(2, 2, 8, 6, 8), (MODBUS, BUSES - MODBUS, AXES, NODES, WRITES)]
    {
        canopen.nodes[0].writes.truncate(2);
        let node = node(&mut canopen, writes);
        println!("{node}");
        let largest = rest + lines * bus + cans * can_bus + axes * axis + nodes * node;
        let room = 384 + lines * 448 + cans * 304 + axes * 288 + nodes * (304 + writes * 16);
        assert!(2 * largest <= room, "{largest} {room}");
    }
}
