use super::super::{Cidr, Drive, Echo, Edb, Framed, Modbus, Payload, Pid, Policy, Protocol};
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
    (net.lease_ms, net.idle_s, net.dhcp) = (5000, 86_400, false);
    net.address = Cidr { address: [223, 255, 255, 253].into(), prefix: 30 };
    net.router = Some([223, 255, 255, 254].into());
    net.hostname = "h".repeat(32).parse().expect("a name");
    // As many commas as a text of 128 characters has.
    let units: std::vec::Vec<_> = (0..36).map(|number| (100 + 2 * number).to_string()).collect();
    let bus = &mut settings.buses[0];
    bus.name = "b".repeat(16).parse().expect("a name");
    bus.port = ("/".to_string() + &"p".repeat(63)).parse().expect("a port");
    bus.baud = 1_000_000;
    bus.protocol = Protocol::ModbusAscii(Modbus {
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

/// Of the parts that [`DOCUMENT`] and two such documents in a record are made of: version and net, a bus, an axis.
#[test]
fn the_form_has_room_for_the_largest_document_and_for_a_record_of_two() {
    let settings = largest();
    let bus = json(&settings.buses[0]).len();
    let axis = json(&settings.axes[0]).len();
    // A comma follows all but the last of each.
    let net = json(&settings).len() - bus - axis;
    println!("{net} {bus} {axis}");
    assert!(net <= 336 && bus < 448 && axis < 288);
    // A framed bus and its axes take less, in either form.
    let framed = largest_framed();
    let compact = |settings: &Settings| record::emit(&mut [0; 1024], Some(settings), None).expect("room");
    assert!(json(&framed.buses[0]).len() < bus && json(&framed.axes[0]).len() < axis);
    assert!(compact(&framed) < compact(&settings));

    let compact = |settings: &Settings| record::emit(&mut [0; 1024], Some(settings), None).expect("room");
    let mut more = settings.clone();
    more.buses.push(settings.buses[0].clone()).expect("room");
    let bus = compact(&more) - compact(&settings);
    more = settings.clone();
    more.axes.push(settings.axes[0].clone()).expect("room");
    let axis = compact(&more) - compact(&settings);
    let rest = compact(&settings) - bus - axis;
    println!("{rest} {bus} {axis}");
    // On a board and here.
    for (buses, axes) in [(2, 8), (BUSES, AXES)] {
        assert!(2 * (rest + buses * bus + axes * axis) <= 336 + buses * 448 + axes * 288);
    }
}
