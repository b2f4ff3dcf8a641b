//! The console: one command a line, one line back, `ok key=value ...` or `error code text`.

mod command;

use core::fmt::Write;

use puente_line::Duration;
use puente_modbus::request::Request;

use super::lines::Reply;
use super::system::System;
use super::{Gateway, Guest};
use crate::axis::{AxisError, Commander, Jog, Snapshot};
use crate::clock;
use crate::desk::{Class, Failure, Order};
use crate::port;
use crate::settings::Name;
use command::{AxisCommand, BusCommand, Command, Mistake};

const HELP: &str = "ok commands=\"help; axis; axis NAME status|enable|disable|stop|alarm|clear; \
axis NAME jog RPM; axis NAME get PnNNN; axis NAME set PnNNN VALUE; bus; bus NAME status; \
bus NAME scan FIRST-LAST; system; feed\"";

/// A command that needs the drives.
#[derive(Clone, Copy)]
pub(super) enum Task {
    /// To an axis, by its number.
    Axis(u8, AxisCommand),
    /// To a bus, by its number: find the units from the first to the last.
    Scan(u8, (u8, u8)),
    /// Nothing; the reply is written.
    Done,
}

/// Reads a command, and answers it where that needs no drive. `gone` tells that the client has closed its side and may
/// not start motion any more.
pub(super) fn begin(gateway: &Gateway, guest: Guest, gone: bool, line: &[u8], reply: &mut Reply) -> Task {
    if port::obey(line) {
        say(reply, format_args!("ok"));
        end(reply);
        return Task::Done;
    }
    let task = match command::parse(line) {
        Err(mistake) => Err(error(reply, mistake.code(), mistake)),
        Ok(command) if guest.stop_only && !command.stops() => {
            let clients = gateway.settings.net.clients;
            let text = format_args!("{clients} clients are connected; only stop and disable are served");
            Err(error(reply, "full", text))
        }
        Ok(command) if gone && command.moves() => {
            Err(error(reply, "gone", "the client has closed its side, so nothing would stop the axis"))
        }
        Ok(command) => resolve(gateway, command, reply),
    };
    task.unwrap_or_else(|Told| {
        end(reply);
        Task::Done
    })
}

/// The reply has been written.
struct Told;

fn resolve(gateway: &Gateway, command: Command<'_>, reply: &mut Reply) -> Result<Task, Told> {
    match command {
        Command::Help => say(reply, format_args!("{HELP}")),
        Command::Feed => say(reply, format_args!("ok")),
        Command::System => say(reply, format_args!("ok {}", System(gateway))),
        Command::Axes => list(reply, "axes", gateway.axes.iter().map(|(_, axis)| &axis.spec.name)),
        Command::Buses => list(reply, "buses", gateway.settings.buses.iter().map(|bus| &bus.name)),
        Command::Axis(name, command) => match gateway.axes.find(name) {
            Ok(id) => return Ok(Task::Axis(id, command)),
            Err(unknown) => return Err(error(reply, unknown.code(), unknown)),
        },
        Command::Bus(name, command) => match (gateway.settings.bus(name), command) {
            (Some(bus), BusCommand::Scan(units)) => return Ok(Task::Scan(bus, units)),
            (Some(bus), BusCommand::Status) => bus_status(gateway, bus, reply),
            (None, _) => return Err(error(reply, "unknown-bus", "no bus has this name; 'bus' lists them")),
        },
    }
    Err(Told)
}

/// Does what needs the drives, and writes the reply.
pub(super) async fn finish(gateway: &Gateway, guest: Guest, task: Task, reply: &mut Reply) {
    match task {
        Task::Axis(id, command) => {
            let name = gateway.axes.get(id).map_or("", |axis| axis.spec.name.as_str());
            say(reply, format_args!("ok axis={name}"));
            if let Err(failed) = axis(gateway, guest.commander(), id, command, reply).await {
                reply.clear();
                error(reply, failed.code(), format_args!("axis {name}: {failed}"));
            }
            end(reply);
        }
        Task::Scan(bus, units) => {
            scan(gateway, guest, bus, units, reply).await;
            end(reply);
        }
        Task::Done => {}
    }
}

/// What cannot be written any more is cut off.
fn say(reply: &mut Reply, text: core::fmt::Arguments<'_>) {
    let _ = reply.write_fmt(text);
}

fn error(reply: &mut Reply, code: &str, text: impl core::fmt::Display) -> Told {
    say(reply, format_args!("error {code} {text}"));
    Told
}

/// Ends the line, whatever was cut.
fn end(reply: &mut Reply) {
    reply.truncate(reply.len().min(reply.capacity() - 2));
    let _ = reply.push_str("\r\n");
}

fn list<'a>(reply: &mut Reply, key: &str, names: impl Iterator<Item = &'a Name>) {
    say(reply, format_args!("ok {key}="));
    for (index, name) in names.enumerate() {
        let separator = if index == 0 { "" } else { "," };
        say(reply, format_args!("{separator}{name}"));
    }
}

async fn axis(
    gateway: &Gateway,
    by: Commander,
    id: u8,
    command: AxisCommand,
    reply: &mut Reply,
) -> Result<(), AxisError> {
    let axes = &gateway.axes;
    match command {
        AxisCommand::Status => {
            let snapshot = axes.status(id, by, Duration::ZERO).await?;
            status(gateway, id, &snapshot, reply);
        }
        AxisCommand::Enable => {
            axes.enable(id, by).await?;
            say(reply, format_args!(" enabled=1"));
        }
        AxisCommand::Disable => {
            axes.disable(id, by).await?;
            say(reply, format_args!(" enabled=0"));
        }
        AxisCommand::Stop => {
            axes.stop(id, by).await?;
            say(reply, format_args!(" jog_rpm=0"));
        }
        AxisCommand::Jog(rpm) => {
            axes.jog(id, by, rpm, None).await?;
            say(reply, format_args!(" jog_rpm={rpm} lease_ms={}", gateway.settings.net.lease_ms));
        }
        AxisCommand::Get(parameter) => {
            let value = axes.parameter(id, by, parameter).await?;
            say(reply, format_args!(" {parameter}={value}"));
            if let Some(unit) = parameter.info().and_then(|info| info.unit) {
                say(reply, format_args!(" unit={unit}"));
            }
        }
        AxisCommand::Set(parameter, value) => {
            axes.set_parameter(id, by, parameter, value).await?;
            say(reply, format_args!(" {parameter}={value}"));
        }
        AxisCommand::Alarm => {
            let number = axes.alarm(id, by).await?;
            let text = puente_drives::edb::alarm_name(number).unwrap_or(if number == 0 {
                "none"
            } else {
                "undefined"
            });
            say(reply, format_args!(" alarm={number} text=\"{text}\""));
        }
        AxisCommand::Clear => {
            axes.clear(id, by).await?;
            let number = axes.alarm(id, by).await?;
            say(reply, format_args!(" enabled=0 alarm={number}"));
        }
    }
    Ok(())
}

fn status(gateway: &Gateway, id: u8, snapshot: &Snapshot, reply: &mut Reply) {
    let now = clock::now();
    let Snapshot { at, status, monitor } = snapshot;
    say(reply, format_args!(" status={:04X} flags={status}", status.0));
    if let Ok(axis) = gateway.axes.get(id) {
        let known = axis.known();
        match known.enabled {
            Some(enabled) => say(reply, format_args!(" enabled={}", u8::from(enabled))),
            None => say(reply, format_args!(" enabled=?")),
        }
        match known.jog {
            Jog::Still => say(reply, format_args!(" jog_rpm=0")),
            Jog::At(rpm) => say(reply, format_args!(" jog_rpm={rpm}")),
            Jog::Unknown => say(reply, format_args!(" jog_rpm=?")),
        }
    }
    say(
        reply,
        format_args!(
            " speed_rpm={} torque_percent={} position_pulses={} alarm={} age_ms={}",
            monitor.speed_feedback,
            monitor.internal_torque_reference,
            monitor.position,
            monitor.alarm,
            now.since(*at).as_millis()
        ),
    );
    if let Some((holder, left)) = gateway.axes.leased(id) {
        say(reply, format_args!(" lease=\"{holder}\" lease_ms={}", left.as_millis()));
    }
    if let Some(event) = gateway.axes.event(id) {
        say(
            reply,
            format_args!(" event={} event_age_ms={}", event.cause.name(), now.since(event.at).as_millis()),
        );
    }
}

fn bus_status(gateway: &Gateway, bus: u8, reply: &mut Reply) {
    let (Some(counted), Some(settings)) =
        (gateway.desk.statistics(bus), gateway.settings.buses.get(usize::from(bus)))
    else {
        return;
    };
    let mean = counted.latency_sum_us / u64::from(counted.confirmed.max(1));
    let _ = write!(
        reply,
        "ok bus={} protocol={} port={} baud={} format={} requests={} confirmed={} exceptions={} no_reply={} \
         not_sent={} late={} bad_check={} garbage={} echoes={} waiting={} resting={} mean_us={mean}",
        settings.name,
        settings.protocol.name(),
        settings.port,
        settings.baud,
        settings.format,
        counted.submitted,
        counted.confirmed,
        counted.exceptions,
        counted.no_reply,
        counted.expired + counted.rested + counted.stopped + counted.line_down + counted.queue_full,
        counted.line.late,
        counted.line.check_errors,
        counted.line.garbage_bytes,
        counted.line.echoes,
        counted.waiting,
        counted.resting,
    );
}

/// Asks each unit for one register; whatever answers, if only with an exception, is there.
async fn scan(gateway: &Gateway, guest: Guest, bus: u8, (first, last): (u8, u8), reply: &mut Reply) {
    let name = gateway.settings.buses.get(usize::from(bus)).map_or("", |bus| bus.name.as_str());
    say(reply, format_args!("ok bus={name} scanned={first}-{last} found="));
    let mut separator = "";
    for unit in first..=last {
        match probe(gateway, guest, bus, unit).await {
            Ok(()) => {
                say(reply, format_args!("{separator}{unit}"));
                separator = ",";
            }
            Err(Failure::NoReply(_)) => {}
            Err(failure) => {
                reply.clear();
                error(reply, "not-sent", format_args!("scan ended at unit {unit}: {failure}"));
                return;
            }
        }
    }
}

async fn probe(gateway: &Gateway, guest: Guest, bus: u8, unit: u8) -> Result<(), Failure> {
    let address = puente_drives::edb::register::STATUS;
    let pdu = Request::ReadHoldingRegisters { address, quantity: 1 }.emit();
    let order = Order { seat: guest.seat, bus, unit, class: Class::Probe, pdu };
    let mut pending = gateway.desk.submit(clock::now(), order)?;
    pending.answer(|answer| answer.map(|_| ())).await
}

impl Mistake<'_> {
    const fn code(&self) -> &'static str {
        match self {
            Mistake::Text => "text",
            Mistake::Unknown(_) => "unknown-command",
            Mistake::Usage(_) => "usage",
            Mistake::Parameter(_) => "parameter",
            Mistake::Number(_) => "number",
            Mistake::Unsupported(_) => "unsupported",
        }
    }
}
