use puente_drives::edb::{Monitor, Registers, Status};
use puente_drives::pid::{Cause as Fault, State};
use puente_line::{Duration, Instant};
use puente_modbus::Counters;
use puente_modules::{Form, Report};

use super::super::reply::BODY;
use super::*;
use crate::axis::edb::{Jog, Snapshot};
use crate::axis::{self, AxisError, AxisSpec, DriveSpec, Known};
use crate::desk::{Cause, Event, Failure, Feedback, Holder, Input, Leased, Reason, Statistics, View, Wish};
use crate::settings;

fn text(value: &impl Serialize) -> std::string::String {
    let mut buffer = [0; BODY];
    let length = serde_json_core::to_slice(value, &mut buffer).expect("it fits");
    core::str::from_utf8(&buffer[..length]).expect("text").into()
}

fn axis(name: &str, address: u8, drive: DriveSpec) -> axis::Axis {
    AxisSpec {
        name: name.try_into().expect("short"),
        bus: 0,
        bus_name: if name.len() > 1 { name } else { "a" }.try_into().expect("short"),
        address,
        drive,
    }
    .into()
}

fn edb(max_rpm: u16) -> DriveSpec {
    DriveSpec::Edb(axis::edb::Spec { max_rpm, registers: Registers::default() })
}

fn pid() -> DriveSpec {
    DriveSpec::Pid(axis::pid::Spec { form: Form::Text, within: Duration::from_millis(100) })
}

fn known(enabled: Option<bool>, jog: Jog, snapshot: Option<Snapshot>) -> Known {
    Known::Edb(axis::edb::Known { enabled, jog, snapshot })
}

#[test]
fn an_axis_with_all_there_is() {
    let at = Instant::from_millis(1000);
    let monitor = Monitor {
        speed_feedback: -99,
        internal_torque_reference: 7,
        position: -20_001,
        alarm: 14,
        ..Monitor::default()
    };
    let holder = Holder::Http(0x1A);
    let found = Findings {
        now: Instant::from_millis(1234),
        axis: &axis("x", 1, edb(3000)),
        known: known(Some(true), Jog::At(-100), Some(Snapshot { at, status: Status(0x8163), monitor })),
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
        axis: &axis("x", 1, edb(3000)),
        known: known(None, Jog::Unknown, None),
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

fn view(state: State) -> View {
    let (following_error, velocity, command) = (-3, 250.5, -0.125);
    let report = Report { state, refused: None, position: 1003, following_error, velocity, command };
    let input = Input { at: Instant::from_millis(1000), feedback: Feedback::Module(report), current: true };
    let gains = puente_drives::pid::Gains::new(0.5, 2.0, 0.0).expect("gains");
    View { wish: Wish::Hold, gains, input: Some(input), shown: true }
}

#[test]
fn a_module_with_all_there_is() {
    let holder = Holder::Http(0x1A);
    let mut found = Findings {
        now: Instant::from_millis(1007),
        axis: &axis("x", 17, pid()),
        known: Known::Pid(view(State::Held)),
        lease: Some((holder, Duration::from_millis(180))),
        event: None,
        error: None,
    };
    assert_eq!(
        text(&Axis::new(&found)),
        "{\"name\":\"x\",\"bus\":\"a\",\"address\":17,\"drive\":\"pid\",\"online\":true,\"enabled\":true,\
         \"state\":\"held\",\"fault\":null,\"position\":1003,\"set_point\":1000,\"reference\":1000,\
         \"velocity\":250.5,\"command_percent\":-12.5,\"gains\":{\"kp\":0.5,\"ki\":2.0,\"kd\":0.0},\"age_ms\":7,\
         \"lease\":{\"holder\":\"web client 0000001a\",\"left_ms\":180},\"event\":null,\"error\":null}"
    );
    found.known = Known::Pid(view(State::Fault(Fault::Communication)));
    let fault = text(&Axis::new(&found));
    assert!(fault.contains("\"enabled\":false,\"state\":\"fault\",\"fault\":\"no set-points\""), "{fault}");
    // Its last values, as long as it says no more.
    found.error = Some(AxisError::Failure(Failure::NotSent(Reason::LineDown)));
    let silent = text(&Axis::new(&found));
    assert!(silent.contains("\"online\":false,\"enabled\":null,\"state\":\"fault\""), "{silent}");
    found.known = Known::Pid(View::default());
    let unheard = text(&Axis::new(&found));
    assert!(
        unheard.contains("\"state\":null,\"fault\":null,\"position\":null,\"set_point\":null"),
        "{unheard}"
    );
}

#[test]
fn what_a_module_was_told() {
    let told = |state, lease| text(&Commanded::new("x", Known::Pid(view(state)), lease));
    assert_eq!(
        told(State::Enabled, Some((Holder::Connection(3), Duration::from_millis(250)))),
        "{\"axis\":\"x\",\"enabled\":true,\"state\":\"following\",\"set_point\":1000,\
         \"lease\":{\"holder\":\"client 3\",\"left_ms\":250}}"
    );
    assert_eq!(
        told(State::Disabled, None),
        "{\"axis\":\"x\",\"enabled\":false,\"state\":\"disabled\",\"set_point\":1000,\"lease\":null}"
    );
}

#[test]
fn the_longest_fits_the_buffer() {
    let name: settings::Name = "abcdefghijklmnop".try_into().expect("short");
    let longest = (0..64)
        .max_by_key(|number| puente_drives::edb::alarm_name(*number).unwrap_or("undefined").len())
        .expect("an alarm");
    let monitor = Monitor {
        speed_feedback: i16::MIN,
        internal_torque_reference: i16::MIN,
        position: i32::MIN,
        alarm: longest,
        ..Monitor::default()
    };
    let now = Instant::from_micros(u64::MAX);
    let holder = Holder::Connection(u32::MAX);
    let found = Findings {
        now,
        axis: &axis(&name, 247, edb(32_767)),
        known: known(
            Some(false),
            Jog::At(i16::MIN),
            Some(Snapshot { at: Instant::ZERO, status: Status(0xFFFF), monitor }),
        ),
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
    let length = text(&Bus::new(bus, &statistics, &Default::default(), false, &Default::default())).len();
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
        text(&Commanded::new("x", known(Some(true), Jog::At(-100), None), None)),
        "{\"axis\":\"x\",\"enabled\":true,\"jog_rpm\":-100,\"lease\":null}"
    );
}

#[test]
fn the_mean_latency_needs_a_reply() {
    let none = bus::Counted::new(&Statistics::default());
    assert_eq!(none.latency_mean_us, None);
    let some = bus::Counted::new(&Statistics { confirmed: 3, latency_sum_us: 100, ..Statistics::default() });
    assert_eq!(some.latency_mean_us, Some(33));
}
