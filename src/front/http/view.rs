//! What the replies say of axes, parameters and buses. The names of the fields are the interface, see docs/http.md.

use core::fmt;

use heapless::Vec;
use puente_drives::edb::{self, Parameter, Status};
use puente_line::{Instant, millis};
use puente_modbus::Counters;
use serde::{Serialize, Serializer};

use super::problem::Problem;
use crate::axis::{AxisError, AxisSpec, Jog, Known};
use crate::clock;
use crate::desk::{Event, Holder, Statistics};
use crate::settings;
use crate::settings::keeper::{Keeper, TRIAL};

/// A value that is shown as the text it has for people.
pub(super) struct Text<T>(pub T);

impl<T: fmt::Display> Serialize for Text<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&self.0)
    }
}

/// Four hexadecimal digits.
pub(super) struct Word(u16);

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}", self.0)
    }
}

/// An axis, and its last values where there are any.
#[derive(Serialize)]
pub(super) struct Axis<'a> {
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

/// Who commands an axis, and for how long unless it goes on.
#[derive(Serialize)]
pub(super) struct Lease {
    holder: Text<Holder>,
    left_ms: u64,
}

/// How the last commander lost the axis.
#[derive(Serialize)]
pub(super) struct Latched {
    cause: &'static str,
    holder: Text<Holder>,
    age_ms: u64,
}

/// What there is to say of an axis at one moment.
pub(super) struct Findings<'a> {
    pub now: Instant,
    pub spec: &'a AxisSpec,
    pub drive: &'static str,
    pub known: Known,
    pub lease: Option<(Holder, puente_line::Duration)>,
    pub event: Option<Event>,
    /// Why there are no fresh values.
    pub error: Option<AxisError>,
}

impl<'a> Axis<'a> {
    pub(super) fn new(found: &Findings<'a>) -> Self {
        let Findings { now, spec, known, .. } = *found;
        let monitor = known.snapshot.map(|snapshot| snapshot.monitor);
        let status = known.snapshot.map(|snapshot| snapshot.status);
        Self {
            name: &spec.name,
            bus: &spec.bus_name,
            address: spec.address,
            drive: found.drive,
            max_rpm: spec.max_rpm,
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
            age_ms: known.snapshot.map(|snapshot| millis(now.since(snapshot.at))),
            lease: found.lease.map(Lease::new),
            event: found.event.map(|event| Latched {
                cause: event.cause.name(),
                holder: Text(event.holder),
                age_ms: millis(now.since(event.at)),
            }),
            error: found.error.map(Problem::Axis),
        }
    }
}

impl Lease {
    fn new((holder, left): (Holder, puente_line::Duration)) -> Self {
        Self { holder: Text(holder), left_ms: millis(left) }
    }
}

/// The commanded jog in r/min, where it is known.
pub(super) const fn jog_rpm(jog: Jog) -> Option<i16> {
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
pub(super) struct Commanded<'a> {
    axis: &'a str,
    enabled: Option<bool>,
    jog_rpm: Option<i16>,
    lease: Option<Lease>,
}

impl<'a> Commanded<'a> {
    pub(super) fn new(name: &'a str, known: Known, lease: Option<(Holder, puente_line::Duration)>) -> Self {
        Self { axis: name, enabled: known.enabled, jog_rpm: jog_rpm(known.jog), lease: lease.map(Lease::new) }
    }
}

/// A parameter.
#[derive(Serialize)]
pub(super) struct ParameterValue<'a> {
    axis: &'a str,
    parameter: Text<Parameter>,
    value: u16,
    unit: Option<&'static str>,
    name: Option<&'static str>,
    min: Option<u16>,
    max: Option<u16>,
    default: Option<u16>,
}

impl<'a> ParameterValue<'a> {
    pub(super) fn new(axis: &'a str, parameter: Parameter, value: u16) -> Self {
        let info = parameter.info();
        Self {
            axis,
            parameter: Text(parameter),
            value,
            unit: info.and_then(|info| info.unit),
            name: info.map(|info| info.name),
            min: info.and_then(|info| info.min),
            max: info.and_then(|info| info.max),
            default: info.and_then(|info| info.default),
        }
    }
}

/// A bus, under the names that the settings have, and what was counted on it.
#[derive(Serialize)]
pub(super) struct Bus<'a> {
    name: &'a str,
    protocol: &'static str,
    port: &'a str,
    baud: u32,
    format: Text<puente_line::Format>,
    units: Text<crate::desk::Units>,
    reply_timeout_ms: u32,
    turnaround_ms: u32,
    rest_ms: u32,
    quarantine_ms: u32,
    queue_timeout_ms: u32,
    echo: settings::Echo,
    statistics: Counted,
}

#[derive(Serialize)]
struct Counted {
    submitted: u32,
    confirmed: u32,
    exceptions: u32,
    broadcasts: u32,
    no_reply: u32,
    expired: u32,
    rested: u32,
    stopped: u32,
    line_down: u32,
    queue_full: u32,
    waiting: usize,
    resting: usize,
    /// Mean time from queueing to reply, in µs; none before the first reply.
    latency_mean_us: Option<u64>,
    line: Line,
}

#[derive(Serialize)]
struct Line {
    requests: u32,
    replies: u32,
    exceptions: u32,
    timeouts: u32,
    check_errors: u32,
    wrong_unit: u32,
    wrong_function: u32,
    wrong_length: u32,
    late: u32,
    echoes: u32,
    garbage_bytes: u32,
    line_errors: u32,
}

impl<'a> Bus<'a> {
    pub(super) fn new(bus: &'a settings::Bus, statistics: &Statistics) -> Self {
        let modbus = bus.modbus().cloned().unwrap_or_default();
        Self {
            name: &bus.name,
            protocol: bus.protocol.name(),
            port: &bus.port,
            baud: bus.baud,
            format: Text(bus.format),
            units: Text(modbus.units),
            reply_timeout_ms: modbus.reply_timeout_ms,
            turnaround_ms: modbus.turnaround_ms,
            rest_ms: modbus.rest_ms,
            quarantine_ms: modbus.quarantine_ms.unwrap_or(modbus.reply_timeout_ms),
            queue_timeout_ms: modbus.queue_timeout_ms,
            echo: modbus.echo,
            statistics: Counted::new(statistics),
        }
    }
}

impl Counted {
    fn new(statistics: &Statistics) -> Self {
        Self {
            submitted: statistics.submitted,
            confirmed: statistics.confirmed,
            exceptions: statistics.exceptions,
            broadcasts: statistics.broadcasts,
            no_reply: statistics.no_reply,
            expired: statistics.expired,
            rested: statistics.rested,
            stopped: statistics.stopped,
            line_down: statistics.line_down,
            queue_full: statistics.queue_full,
            waiting: statistics.waiting,
            resting: statistics.resting,
            latency_mean_us: statistics.latency_sum_us.checked_div(u64::from(statistics.confirmed)),
            line: Line::new(&statistics.line),
        }
    }
}

impl Line {
    const fn new(counters: &Counters) -> Self {
        let Counters { requests, replies, exceptions, timeouts, check_errors, wrong_unit, .. } = *counters;
        let Counters { wrong_function, wrong_length, late, echoes, garbage_bytes, line_errors, .. } =
            *counters;
        Self {
            requests,
            replies,
            exceptions,
            timeouts,
            check_errors,
            wrong_unit,
            wrong_function,
            wrong_length,
            late,
            echoes,
            garbage_bytes,
            line_errors,
        }
    }
}

/// The settings in force: where they come from, and for how long they stay where nobody confirms them.
#[derive(Serialize)]
pub(super) struct ConfigState {
    settings: &'static str,
    trial_left_s: Option<u64>,
}

impl ConfigState {
    pub(super) fn new(keeper: &Keeper) -> Self {
        let left = keeper.trial_left(clock::now());
        Self { settings: keeper.source().name(), trial_left_s: left.map(|left| millis(left).div_ceil(1000)) }
    }
}

/// A change of the settings that has been accepted.
#[derive(Serialize)]
pub(super) struct Changed {
    restart: bool,
    confirm_within_s: Option<u64>,
}

impl Changed {
    pub(super) fn new(on_trial: bool) -> Self {
        Self { restart: true, confirm_within_s: on_trial.then_some(TRIAL.as_secs()) }
    }
}

#[cfg(test)]
mod tests;
