//! The console: one command a line, one line back, `ok key=value ...` or `error code text`.

mod command;

use core::fmt::Write;

use puente_line::Duration;
use puente_modbus::request::Request;

use super::lines::Reply;
use super::{Gateway, Guest};
use crate::axis::{AxisError, Commander, Jog, Snapshot};
use crate::clock;
use crate::desk::{Class, Failure, Order};
use command::{AxisCommand, BusCommand, Command, Mistake};

const HELP: &str = "ok commands=\"help; axis; axis NAME status|enable|disable|stop|alarm|clear; \
axis NAME jog RPM; axis NAME get PnNNN; axis NAME set PnNNN VALUE; bus; bus NAME status; \
bus NAME scan FIRST-LAST; feed\"";

/// Carries out a command. `gone` tells that the client has closed its side and may not start motion any more.
pub(super) async fn answer(gateway: &Gateway, guest: Guest, gone: bool, line: &[u8]) -> Reply {
    let mut reply = Reply::new();
    // A reply that does not fit is cut; the longest is the help text, which fits.
    let _ = match command::parse(line) {
        Err(mistake) => write!(reply, "error {} {mistake}", mistake.code()),
        Ok(command) if guest.stop_only && !command.stops() => {
            write!(
                reply,
                "error full {} clients are connected; only stop and disable are served",
                gateway.settings.net.clients
            )
        }
        Ok(command) if gone && command.moves() => reply
            .push_str("error gone the client has closed its side, so nothing would stop the axis")
            .map_err(|_| core::fmt::Error),
        Ok(Command::Help) => reply.push_str(HELP).map_err(|_| core::fmt::Error),
        Ok(Command::Feed) => reply.push_str("ok").map_err(|_| core::fmt::Error),
        Ok(Command::Axes) => axes(gateway, &mut reply),
        Ok(Command::Buses) => buses(gateway, &mut reply),
        Ok(Command::Axis(name, command)) => {
            match axis(gateway, guest.commander(), name, command, &mut reply).await {
                Ok(()) => Ok(()),
                Err(error) => {
                    reply.clear();
                    write!(reply, "error {} axis {name}: {error}", error.code())
                }
            }
        }
        Ok(Command::Bus(name, command)) => match gateway.settings.bus(name) {
            None => write!(reply, "error unknown-bus no bus has the name {name}; 'bus' lists them"),
            Some(bus) => match command {
                BusCommand::Status => bus_status(gateway, bus, &mut reply),
                BusCommand::Scan(units) => scan(gateway, guest, bus, units, &mut reply).await,
            },
        },
    };
    // Room for the line end, whatever was cut.
    reply.truncate(reply.len().min(reply.capacity() - 2));
    let _ = reply.push_str("\r\n");
    reply
}

fn axes(gateway: &Gateway, reply: &mut Reply) -> core::fmt::Result {
    reply.write_str("ok axes=")?;
    for (id, axis) in gateway.axes.iter() {
        let separator = if id == 0 { "" } else { "," };
        write!(reply, "{separator}{}", axis.spec.name)?;
    }
    Ok(())
}

fn buses(gateway: &Gateway, reply: &mut Reply) -> core::fmt::Result {
    reply.write_str("ok buses=")?;
    for (index, bus) in gateway.settings.buses.iter().enumerate() {
        let separator = if index == 0 { "" } else { "," };
        write!(reply, "{separator}{}", bus.name)?;
    }
    Ok(())
}

/// What cannot be written any more is cut off.
fn say(reply: &mut Reply, text: core::fmt::Arguments<'_>) {
    let _ = reply.write_fmt(text);
}

async fn axis(
    gateway: &Gateway,
    by: Commander,
    name: &str,
    command: AxisCommand,
    reply: &mut Reply,
) -> Result<(), AxisError> {
    let axes = &gateway.axes;
    let id = axes.find(name)?;
    say(reply, format_args!("ok axis={name}"));
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

fn bus_status(gateway: &Gateway, bus: u8, reply: &mut Reply) -> core::fmt::Result {
    let (Some(counted), Some(settings)) =
        (gateway.desk.statistics(bus), gateway.settings.buses.get(usize::from(bus)))
    else {
        return Ok(());
    };
    let mean = counted.latency_sum_us / u64::from(counted.confirmed.max(1));
    write!(
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
    )
}

/// Asks each unit for one register; whatever answers, if only with an exception, is there.
async fn scan(
    gateway: &Gateway,
    guest: Guest,
    bus: u8,
    (first, last): (u8, u8),
    reply: &mut Reply,
) -> core::fmt::Result {
    write!(
        reply,
        "ok bus={} scanned={first}-{last} found=",
        gateway.settings.buses.get(usize::from(bus)).map_or("", |b| b.name.as_str())
    )?;
    let address = puente_drives::edb::register::STATUS;
    let mut separator = "";
    for unit in first..=last {
        let pdu = Request::ReadHoldingRegisters { address, quantity: 1 }.emit();
        let order = Order { seat: guest.seat, bus, unit, class: Class::Probe, pdu };
        let answer = match gateway.desk.submit(clock::now(), order) {
            Ok(pending) => pending.await,
            Err(failure) => Err(failure),
        };
        match answer {
            Ok(_) => {
                write!(reply, "{separator}{unit}")?;
                separator = ",";
            }
            Err(Failure::NoReply(_)) => {}
            Err(failure) => {
                reply.clear();
                return write!(reply, "error not-sent scan ended at unit {unit}: {failure}");
            }
        }
    }
    Ok(())
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
