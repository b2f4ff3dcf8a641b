use puente_line::Duration;

use super::super::reply::BODY;
use super::*;
use crate::axis::Snapshot;
use crate::desk::{Cause, Failure, Leased, Reason};

fn text(value: &impl Serialize) -> std::string::String {
    let mut buffer = [0; BODY];
    let length = serde_json_core::to_slice(value, &mut buffer).expect("it fits");
    core::str::from_utf8(&buffer[..length]).expect("text").into()
}

fn spec() -> AxisSpec {
    AxisSpec {
        name: "x".try_into().expect("short"),
        bus: 0,
        bus_name: "a".try_into().expect("short"),
        address: 1,
        max_rpm: 3000,
        registers: edb::Registers::default(),
    }
}

fn known(snapshot: Option<Snapshot>) -> Known {
    Known { enabled: Some(true), jog: Jog::At(-100), snapshot }
}

#[test]
fn an_axis_with_all_there_is() {
    let at = Instant::from_millis(1000);
    let monitor = edb::Monitor {
        speed_feedback: -99,
        internal_torque_reference: 7,
        position: -20_001,
        alarm: 14,
        ..edb::Monitor::default()
    };
    let holder = Holder::Http(0x1A);
    let found = Findings {
        now: Instant::from_millis(1234),
        spec: &spec(),
        drive: "edb",
        known: known(Some(Snapshot { at, status: Status(0x8163), monitor })),
        lease: Some((holder, Duration::from_micros(180_999))),
        event: Some(Event { cause: Cause::Expired, holder, at }),
        error: None,
    };
    assert_eq!(
        text(&Axis::new(&found)),
        "{\"name\":\"x\",\"bus\":\"a\",\"address\":1,\"drive\":\"edb\",\"max_rpm\":3000,\"online\":true,\
         \"enabled\":true,\"jog_rpm\":-100,\"speed_rpm\":-99,\"torque_percent\":7,\"position_pulses\":-20001,\
         \"alarm\":14,\"alarm_text\":\"under-voltage\",\"status\":\"8163\",\
         \"flags\":[\"ALM\",\"S-RDY\",\"COIN\",\"AC-IN\",\"N-OT\",\"P-OT\"],\"age_ms\":234,\
         \"lease\":{\"holder\":\"web client 0000001a\",\"left_ms\":180},\
         \"event\":{\"cause\":\"lease-expired\",\"holder\":\"web client 0000001a\",\"age_ms\":234},\"error\":null}"
    );
}

#[test]
fn an_axis_never_heard() {
    let resting = Failure::NotSent(Reason::Resting(Duration::from_millis(4210)));
    let found = Findings {
        now: Instant::from_millis(1234),
        spec: &spec(),
        drive: "edb",
        known: Known { enabled: None, jog: Jog::Unknown, snapshot: None },
        lease: None,
        event: None,
        error: Some(AxisError::Failure(resting)),
    };
    assert_eq!(
        text(&Axis::new(&found)),
        "{\"name\":\"x\",\"bus\":\"a\",\"address\":1,\"drive\":\"edb\",\"max_rpm\":3000,\"online\":false,\
         \"enabled\":null,\"jog_rpm\":null,\"speed_rpm\":null,\"torque_percent\":null,\"position_pulses\":null,\
         \"alarm\":null,\"alarm_text\":null,\"status\":null,\"flags\":[],\"age_ms\":null,\"lease\":null,\
         \"event\":null,\"error\":{\"code\":\"not-sent\",\"message\":\"not sent: the slave did not answer lately and \
         is tried again in 4210 ms\"}}"
    );
    let exception = Findings { error: Some(AxisError::Exception(2)), ..found };
    assert!(text(&Axis::new(&exception)).contains("\"online\":true"), "an exception is an answer");
}

#[test]
fn the_longest_fits_the_buffer() {
    let name: settings::Name = "abcdefghijklmnop".try_into().expect("short");
    let spec =
        AxisSpec { name: name.clone(), bus_name: name.clone(), address: 247, max_rpm: 32_767, ..spec() };
    let longest = (0..64).max_by_key(|number| alarm_text(*number).len()).expect("an alarm");
    let monitor = edb::Monitor {
        speed_feedback: i16::MIN,
        internal_torque_reference: i16::MIN,
        position: i32::MIN,
        alarm: longest,
        ..edb::Monitor::default()
    };
    let now = Instant::from_micros(u64::MAX);
    let holder = Holder::Connection(u32::MAX);
    let found = Findings {
        now,
        spec: &spec,
        drive: "edb",
        known: Known {
            enabled: Some(false),
            jog: Jog::At(i16::MIN),
            snapshot: Some(Snapshot { at: Instant::ZERO, status: Status(0xFFFF), monitor }),
        },
        lease: Some((holder, Duration::MAX)),
        event: Some(Event { cause: Cause::StopUnconfirmed, holder, at: Instant::ZERO }),
        error: Some(AxisError::Leased(Leased::By(holder, Duration::MAX))),
    };
    let length = text(&Axis::new(&found)).len();
    assert!(length > 700, "{length}");

    let mut settings = settings::Settings::factory();
    let bus = &mut settings.buses[0];
    bus.port = "\u{1}".repeat(64).parse().expect("a port");
    bus.name = name;
    // As long as the settings take.
    let units =
        (100..=247).step_by(2).map(|unit| std::format!("{unit}")).collect::<std::vec::Vec<_>>().join(",");
    let units = units[..127].parse().expect("units");
    bus.protocol = settings::Protocol::ModbusAscii(settings::Modbus { units, ..Default::default() });
    let most = u32::MAX;
    let statistics = Statistics {
        submitted: most,
        confirmed: most,
        exceptions: most,
        broadcasts: most,
        no_reply: most,
        expired: most,
        rested: most,
        stopped: most,
        line_down: most,
        queue_full: most,
        waiting: 999,
        resting: 999,
        latency_sum_us: u64::MAX,
        latency: Default::default(),
        line: Counters {
            requests: most,
            replies: most,
            exceptions: most,
            timeouts: most,
            check_errors: most,
            wrong_unit: most,
            wrong_function: most,
            wrong_length: most,
            late: most,
            echoes: most,
            garbage_bytes: most,
            line_errors: most,
        },
    };
    let length = text(&Bus::new(bus, &statistics)).len();
    assert!(length > 1000, "{length}");
}

#[test]
fn parameters_and_commands() {
    assert_eq!(
        text(&ParameterValue::new("x", Parameter::FRAME, 5)),
        "{\"axis\":\"x\",\"parameter\":\"Pn212\",\"value\":5,\"unit\":null,\"name\":\"frame format\",\"min\":0,\
         \"max\":8,\"default\":5}"
    );
    assert_eq!(
        text(&Commanded::new("x", known(None), None)),
        "{\"axis\":\"x\",\"enabled\":true,\"jog_rpm\":-100,\"lease\":null}"
    );
}

#[test]
fn the_mean_latency_needs_a_reply() {
    let none = Counted::new(&Statistics::default());
    assert_eq!(none.latency_mean_us, None);
    let some = Counted::new(&Statistics { confirmed: 3, latency_sum_us: 100, ..Statistics::default() });
    assert_eq!(some.latency_mean_us, Some(33));
}
