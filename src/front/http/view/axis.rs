//! What is said of an axis.

use core::fmt;

use heapless::Vec;
use puente_canopen::emcy::Emergency;
use puente_drives::cia402::Mode;
use puente_drives::edb::{self, Status};
use puente_drives::pid::{Cause, State};
use puente_line::{Duration, Instant, millis};
use puente_servos::{Failure, Node, Progress};
use serde::Serialize;

use super::super::problem::Problem;
use super::{Gains, Text};
use crate::axis::edb::Jog;
use crate::axis::{self, AxisError, DriveSpec, Known};
use crate::desk::{self, Event, Holder};

/// Four hexadecimal digits.
pub(super) struct Word(u16);

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}", self.0)
    }
}

/// An axis, and its last values where there are any.
#[derive(Serialize)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant, reason = "there is no heap, and one lives at a time")]
pub(in crate::front::http) enum Axis<'a> {
    Edb(Edb<'a>),
    Pid(Pid<'a>),
    Cia402(Cia402<'a>),
}

#[derive(Serialize)]
pub(in crate::front::http) struct Edb<'a> {
    name: &'a str,
    bus: &'a str,
    address: u8,
    drive: &'static str,
    max_rpm: u16,
    online: bool,
    enabled: Option<bool>,
    jog_rpm: Option<i16>,
    speed_rpm: Option<i16>,
    torque_percent: Option<i16>,
    position_pulses: Option<i32>,
    alarm: Option<u16>,
    alarm_text: Option<&'static str>,
    status: Option<Text<Word>>,
    flags: Vec<&'static str, 10>,
    age_ms: Option<u64>,
    lease: Option<Lease>,
    event: Option<Latched>,
    error: Option<Problem>,
}

#[derive(Serialize)]
pub(in crate::front::http) struct Pid<'a> {
    name: &'a str,
    bus: &'a str,
    address: u8,
    drive: &'static str,
    online: bool,
    enabled: Option<bool>,
    state: Option<&'static str>,
    fault: Option<Text<Cause>>,
    position: Option<i32>,
    set_point: Option<i32>,
    reference: Option<i32>,
    velocity: Option<f32>,
    command_percent: Option<f32>,
    gains: Option<Gains>,
    age_ms: Option<u64>,
    lease: Option<Lease>,
    event: Option<Latched>,
    error: Option<Problem>,
}

/// Positions and velocities are in the drive's own units.
#[derive(Serialize)]
pub(in crate::front::http) struct Cia402<'a> {
    name: &'a str,
    bus: &'a str,
    address: u8,
    drive: &'static str,
    profile: &'static str,
    online: bool,
    enabled: Option<bool>,
    node: Option<&'static str>,
    node_text: Option<Text<Node>>,
    state: Option<&'static str>,
    status: Option<Text<Word>>,
    mode: Option<Text<Mode>>,
    homed: Option<bool>,
    position: Option<i32>,
    set_point: Option<i32>,
    velocity: Option<i32>,
    progress: Option<&'static str>,
    failure: Option<Text<Failure>>,
    fault: Option<Text<Word>>,
    emergency: Option<Text<Emergency>>,
    age_ms: Option<u64>,
    lease: Option<Lease>,
    event: Option<Latched>,
    error: Option<Problem>,
}

/// Who commands an axis, and for how long unless it goes on.
#[derive(Serialize)]
pub(in crate::front::http) struct Lease {
    holder: Text<Holder>,
    left_ms: u64,
}

/// How the last commander lost the axis.
#[derive(Serialize)]
struct Latched {
    cause: &'static str,
    holder: Text<Holder>,
    age_ms: u64,
}

/// What there is to say of an axis at one moment.
pub(in crate::front::http) struct Findings<'a> {
    pub now: Instant,
    pub axis: &'a axis::Axis,
    pub known: Known,
    pub lease: Option<(Holder, Duration)>,
    pub event: Option<Event>,
    /// Why there are no fresh values.
    pub error: Option<AxisError>,
}

impl<'a> Axis<'a> {
    pub(in crate::front::http) fn new(found: &Findings<'a>) -> Self {
        match &found.known {
            Known::Edb(known) => Axis::Edb(Edb::new(found, known)),
            Known::Pid(view) => Axis::Pid(Pid::new(found, view)),
            Known::Cia402(view) => Axis::Cia402(Cia402::new(found, view)),
        }
    }
}

impl<'a> Edb<'a> {
    fn new(found: &Findings<'a>, known: &axis::edb::Known) -> Self {
        let monitor = known.snapshot.map(|snapshot| snapshot.monitor);
        let status = known.snapshot.map(|snapshot| snapshot.status);
        let max_rpm = match found.axis.drive() {
            DriveSpec::Edb(spec) => spec.max_rpm,
            DriveSpec::Pid(_) | DriveSpec::Cia402(_) => 0,
        };
        Self {
            name: &found.axis.name,
            bus: &found.axis.bus_name,
            address: found.axis.address,
            drive: "edb",
            max_rpm,
            // An exception is an answer, too.
            online: matches!(found.error, None | Some(AxisError::Exception(_))),
            enabled: known.enabled,
            jog_rpm: jog_rpm(known.jog),
            speed_rpm: monitor.map(|monitor| monitor.speed_feedback),
            torque_percent: monitor.map(|monitor| monitor.internal_torque_reference),
            position_pulses: monitor.map(|monitor| monitor.position),
            alarm: monitor.map(|monitor| monitor.alarm),
            alarm_text: monitor.map(|monitor| monitor.alarm).filter(|number| *number != 0).map(alarm_text),
            status: status.map(|status| Text(Word(status.0))),
            flags: status.map(flags).unwrap_or_default(),
            age_ms: known.snapshot.map(|snapshot| millis(found.now.since(snapshot.at))),
            lease: found.lease.map(Lease::new),
            event: found.event.map(|event| Latched::new(found.now, event)),
            error: found.error.map(Problem::Axis),
        }
    }
}

impl<'a> Pid<'a> {
    fn new(found: &Findings<'a>, view: &desk::View) -> Self {
        let online = found.error.is_none();
        let report = view.module().map(|(_, report)| report);
        let state = report.map(|report| report.state);
        Self {
            name: &found.axis.name,
            bus: &found.axis.bus_name,
            address: found.axis.address,
            drive: "pid",
            online,
            enabled: state.filter(|_| online).map(axis::pid::enabled),
            state: state.map(axis::pid::state),
            fault: match state {
                Some(State::Fault(cause)) => Some(Text(cause)),
                _ => None,
            },
            position: report.map(|report| report.position),
            set_point: axis::pid::set_point(view),
            reference: report.map(|report| axis::pid::reference(&report)),
            velocity: report.map(|report| report.velocity),
            command_percent: report.map(|report| axis::pid::permille(&report) as f32 / 10.0),
            gains: Some(view.gains.into()),
            age_ms: view.module().map(|(at, _)| millis(found.now.since(at))),
            lease: found.lease.map(Lease::new),
            event: found.event.map(|event| Latched::new(found.now, event)),
            error: found.error.map(Problem::Axis),
        }
    }
}

impl<'a> Cia402<'a> {
    fn new(found: &Findings<'a>, view: &desk::View) -> Self {
        let report = view.servo().map(|(_, report)| report);
        let node = report.map(|report| report.node);
        let online = found.error.is_none() && node == Some(Node::Present);
        let state = report.and_then(|report| report.state());
        let profile = match found.axis.drive() {
            DriveSpec::Cia402(spec) => spec.profile.name,
            DriveSpec::Edb(_) | DriveSpec::Pid(_) => "",
        };
        Self {
            name: &found.axis.name,
            bus: &found.axis.bus_name,
            address: found.axis.address,
            drive: "cia402",
            profile,
            online,
            enabled: state.filter(|_| online).map(axis::cia402::powered),
            node: node.as_ref().map(axis::cia402::node),
            node_text: node.map(Text),
            state: state.map(axis::cia402::state),
            status: report.and_then(|report| report.status).map(|status| Text(Word(status.0))),
            mode: report.and_then(|report| report.mode).map(Text),
            homed: report.map(|report| report.homed),
            position: report.and_then(|report| report.position),
            set_point: axis::cia402::target(view),
            velocity: report.and_then(|report| report.velocity),
            progress: report.map(|report| axis::cia402::progress(report.progress)),
            failure: match report.map(|report| report.progress) {
                Some(Progress::Failed(failure)) => Some(Text(failure)),
                _ => None,
            },
            fault: report.and_then(|report| report.fault).map(|code| Text(Word(code))),
            emergency: report.and_then(|report| report.emergency).map(Text),
            age_ms: view.servo().map(|(at, _)| millis(found.now.since(at))),
            lease: found.lease.map(Lease::new),
            event: found.event.map(|event| Latched::new(found.now, event)),
            error: found.error.map(Problem::Axis),
        }
    }
}

impl Lease {
    fn new((holder, left): (Holder, Duration)) -> Self {
        Self { holder: Text(holder), left_ms: millis(left) }
    }
}

impl Latched {
    fn new(now: Instant, event: Event) -> Self {
        Self { cause: event.cause.name(), holder: Text(event.holder), age_ms: millis(now.since(event.at)) }
    }
}

/// The commanded jog in r/min, where it is known.
pub(in crate::front::http) const fn jog_rpm(jog: Jog) -> Option<i16> {
    match jog {
        Jog::Still => Some(0),
        Jog::At(rpm) => Some(rpm),
        Jog::Unknown => None,
    }
}

fn alarm_text(number: u16) -> &'static str {
    edb::alarm_name(number).unwrap_or("undefined")
}

fn flags(status: Status) -> Vec<&'static str, 10> {
    status.names().collect()
}

/// What a command leaves behind.
#[derive(Serialize)]
#[serde(untagged)]
pub(in crate::front::http) enum Commanded<'a> {
    Edb {
        axis: &'a str,
        enabled: Option<bool>,
        jog_rpm: Option<i16>,
        lease: Option<Lease>,
    },
    Pid {
        axis: &'a str,
        enabled: Option<bool>,
        state: Option<&'static str>,
        set_point: Option<i32>,
        lease: Option<Lease>,
    },
    Cia402 {
        axis: &'a str,
        enabled: Option<bool>,
        state: Option<&'static str>,
        mode: Option<Text<Mode>>,
        set_point: Option<i32>,
        progress: Option<&'static str>,
        lease: Option<Lease>,
    },
}

impl<'a> Commanded<'a> {
    pub(in crate::front::http) fn new(
        axis: &'a str,
        known: Known,
        lease: Option<(Holder, Duration)>,
    ) -> Self {
        let lease = lease.map(Lease::new);
        match known {
            Known::Edb(known) => {
                Commanded::Edb { axis, enabled: known.enabled, jog_rpm: jog_rpm(known.jog), lease }
            }
            Known::Pid(view) => {
                let state = view.module().map(|(_, report)| report.state);
                Commanded::Pid {
                    axis,
                    enabled: state.map(axis::pid::enabled),
                    state: state.map(axis::pid::state),
                    set_point: axis::pid::set_point(&view),
                    lease,
                }
            }
            Known::Cia402(view) => {
                let report = view.servo().map(|(_, report)| report);
                let state = report.and_then(|report| report.state());
                Commanded::Cia402 {
                    axis,
                    enabled: state.map(axis::cia402::powered),
                    state: state.map(axis::cia402::state),
                    mode: report.and_then(|report| report.mode).map(Text),
                    set_point: axis::cia402::target(&view),
                    progress: report.map(|report| axis::cia402::progress(report.progress)),
                    lease,
                }
            }
        }
    }
}
