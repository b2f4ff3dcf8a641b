//! The console: one command a line, one line back, `ok key=value ...` or `error code text`.

mod command;
mod node;
mod status;

use core::fmt::Write;

use puente_drives::cia402::Mode;
use puente_drives::edb::Parameter;
use puente_drives::pid::Gains;
use puente_line::Duration;
use puente_modbus::request::Request;
use puente_modules::Decimal;

use super::lines::Reply;
use super::system::System;
use super::{Gateway, Guest};
use crate::axis::group::Set;
use crate::axis::{AxisError, Commander, Known, Snapshot};
use crate::clock;
use crate::desk::{Class, Failure, Order, Units};
use crate::port;
use crate::settings::Name;
use command::{AxisCommand, BusCommand, Command, GroupCommand, Mistake};

const HELP: &str = "ok commands=\"help; axis; axis NAME status|enable|disable|stop|clear; \
EDB: axis NAME jog RPM; axis NAME alarm; axis NAME get PnNNN; axis NAME set PnNNN VALUE; \
PID: axis NAME move POSITION; axis NAME gains KP KI KD; \
CiA 402: axis NAME move POSITION [VELOCITY]; axis NAME home [METHOD]; axis NAME velocity V; axis NAME torque PERMILLE; \
axis NAME mode MODE; group; group NAME,NAME enable|home|start MODE|stop|disable; \
bus; bus NAME status; bus NAME scan FIRST-LAST; \
node BUS [ID status|emcy|start|stop|preop|reset|reset-communication|\
read INDEX:SUB [TYPE]|write INDEX:SUB VALUE [TYPE]]; system; feed\"";

const NO_SCAN: &str =
    "a framed bus has no units to ask; its modules report by themselves, see: axis NAME status";

/// A command that needs the drives.
pub(super) enum Task {
    /// To an axis, by its number.
    Axis(u8, AxisCommand),
    /// To several axes.
    Group(Set, GroupCommand),
    /// To a bus, by its number: find the units from the first to the last.
    Scan(u8, (u8, u8)),
    /// To a node of a CANopen bus.
    Node(node::Task),
}

/// Reads a command, and answers it where that needs no drive: then there is no task. `gone` tells that the client has closed its side and may
/// not start motion any more.
pub(super) fn begin(
    gateway: &Gateway,
    guest: Guest,
    gone: bool,
    line: &[u8],
    reply: &mut Reply,
) -> Option<Task> {
    if port::obey(line) {
        say(reply, format_args!("ok"));
        end(reply);
        return None;
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
        Ok(command) => resolve(gateway, guest, gone, command, reply),
    };
    task.inspect_err(|Told| end(reply)).ok()
}

/// The reply has been written.
struct Told;

fn resolve(
    gateway: &Gateway,
    guest: Guest,
    gone: bool,
    command: Command<'_>,
    reply: &mut Reply,
) -> Result<Task, Told> {
    match command {
        Command::Help => say(reply, format_args!("{HELP}")),
        Command::Feed => say(reply, format_args!("ok")),
        Command::System => say(reply, format_args!("ok {}", System(gateway))),
        Command::Axes => list(reply, "axes", gateway.axes.iter().map(|(_, axis)| &axis.name)),
        Command::Buses => list(reply, "buses", gateway.settings.buses.iter().map(|bus| &bus.name)),
        Command::Nodes(bus) => node::list(gateway, bus, reply)?,
        Command::Node(bus, id, command) => {
            return node::begin(gateway, guest, gone, bus, id, command, reply).map(Task::Node);
        }
        Command::Axis(name, command) => match gateway.axes.find(name) {
            Ok(id) => return Ok(Task::Axis(id, command)),
            Err(unknown) => return Err(error(reply, unknown.code(), unknown)),
        },
        Command::GroupStatus => status::group(gateway, reply),
        Command::Group(names, command) => {
            let find = |set: Set, name| gateway.axes.find(name).map(|id| set.with(id));
            match names.split(',').try_fold(Set::default(), find) {
                Ok(set) => return Ok(Task::Group(set, command)),
                Err(unknown) => return Err(error(reply, unknown.code(), unknown)),
            }
        }
        Command::Bus(name, command) => match (gateway.settings.bus(name), command) {
            (Some(bus), BusCommand::Scan(units)) => {
                match gateway.settings.buses.get(usize::from(bus)).and_then(|bus| bus.modbus()) {
                    Some(_) => return Ok(Task::Scan(bus, units)),
                    None => return Err(error(reply, "unsupported", NO_SCAN)),
                }
            }
            (Some(bus), BusCommand::Status) => status::bus(gateway, bus, reply),
            (None, _) => return Err(error(reply, "unknown-bus", "no bus has this name; 'bus' lists them")),
        },
    }
    Err(Told)
}

/// What has come of a command that needed the drives.
pub(super) enum Outcome {
    /// Of an axis, by its number.
    Axis(u8, Result<Answer, AxisError>),
    /// Of several axes.
    Group(Result<(), AxisError>),
    /// Of the search for units from the first to the last on a bus, by its number.
    Scan(u8, (u8, u8), Result<Units, (u8, Failure)>),
    /// Of a node of a CANopen bus.
    Node(node::Outcome),
}

/// What an axis answers.
pub(super) enum Answer {
    Status(Snapshot),
    Enabled(bool),
    Stopped,
    Jog(i32),
    Move(i32),
    Homing,
    Velocity(i32),
    Torque(i16),
    Mode(Mode),
    Gains(Gains),
    Value(Parameter, u16),
    Written(Parameter, u16),
    Alarm(u16),
    /// The alarm that is left, of a drive that numbers them.
    Cleared(Option<u16>),
}

/// Does what needs the drives. There is no reply yet: its room is that of this future, see [`lines`](super::lines).
pub(super) async fn finish(gateway: &Gateway, guest: Guest, task: &mut Task) -> Outcome {
    match task {
        Task::Axis(id, command) => Outcome::Axis(*id, axis(gateway, guest.commander(), *id, *command).await),
        Task::Group(set, command) => Outcome::Group(group(gateway, guest.commander(), *set, *command).await),
        Task::Scan(bus, units) => Outcome::Scan(*bus, *units, scan(gateway, guest, *bus, *units).await),
        Task::Node(task) => Outcome::Node(node::finish(gateway, task).await),
    }
}

/// Writes the reply.
pub(super) fn tell(gateway: &Gateway, outcome: &Outcome, reply: &mut Reply) {
    match outcome {
        Outcome::Axis(id, answer) => {
            let name = gateway.axes.get(*id).map_or("", |axis| axis.name.as_str());
            match answer {
                Ok(answer) => {
                    say(reply, format_args!("ok axis={name}"));
                    tell_answer(gateway, *id, answer, reply);
                }
                Err(failed) => {
                    error(reply, failed.code(), format_args!("axis {name}: {failed}"));
                }
            }
        }
        Outcome::Group(Ok(())) => status::group(gateway, reply),
        Outcome::Group(Err(failed)) => {
            error(reply, failed.code(), failed);
        }
        Outcome::Scan(bus, (first, last), Ok(found)) => {
            let name = gateway.settings.buses.get(usize::from(*bus)).map_or("", |bus| bus.name.as_str());
            say(reply, format_args!("ok bus={name} scanned={first}-{last} found="));
            separated(reply, found.iter());
        }
        Outcome::Scan(_, _, Err((unit, failure))) => {
            error(reply, "not-sent", format_args!("scan ended at unit {unit}: {failure}"));
        }
        Outcome::Node(outcome) => node::tell(gateway, outcome, reply),
    }
    end(reply);
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
    separated(reply, names);
}

fn separated(reply: &mut Reply, items: impl Iterator<Item = impl core::fmt::Display>) {
    for (index, item) in items.enumerate() {
        let separator = if index == 0 { "" } else { "," };
        say(reply, format_args!("{separator}{item}"));
    }
}

async fn axis(gateway: &Gateway, by: Commander, id: u8, command: AxisCommand) -> Result<Answer, AxisError> {
    let axes = &gateway.axes;
    Ok(match command {
        AxisCommand::Status => Answer::Status(axes.status(id, by, Duration::ZERO).await?),
        AxisCommand::Enable => {
            axes.enable(id, by).await?;
            Answer::Enabled(true)
        }
        AxisCommand::Disable => {
            axes.disable(id, by).await?;
            Answer::Enabled(false)
        }
        AxisCommand::Stop => {
            axes.stop(id, by).await?;
            Answer::Stopped
        }
        AxisCommand::Jog(rpm) => {
            axes.jog(id, by, rpm, None).await?;
            Answer::Jog(rpm)
        }
        AxisCommand::Move(course) => {
            axes.move_to(id, by, course, None, false).await?;
            Answer::Move(course.position)
        }
        AxisCommand::Home(method) => {
            axes.home(id, by, method, None, false).await?;
            Answer::Homing
        }
        AxisCommand::Velocity(velocity) => {
            axes.velocity(id, by, velocity, None).await?;
            Answer::Velocity(velocity)
        }
        AxisCommand::Torque(permille) => {
            axes.torque(id, by, permille, None).await?;
            Answer::Torque(permille)
        }
        AxisCommand::Mode(mode) => {
            axes.mode(id, by, mode, None).await?;
            Answer::Mode(mode)
        }
        AxisCommand::Gains(gains) => {
            axes.set_gains(id, by, gains)?;
            Answer::Gains(gains)
        }
        AxisCommand::Get(parameter) => Answer::Value(parameter, axes.parameter(id, by, parameter).await?),
        AxisCommand::Set(parameter, value) => {
            axes.set_parameter(id, by, parameter, value).await?;
            Answer::Written(parameter, value)
        }
        AxisCommand::Alarm => Answer::Alarm(axes.alarm(id, by).await?),
        AxisCommand::Clear => {
            axes.clear(id, by).await?;
            match axes.alarm(id, by).await {
                Err(AxisError::Unsupported(_)) => Answer::Cleared(None),
                alarm => Answer::Cleared(Some(alarm?)),
            }
        }
    })
}

fn tell_answer(gateway: &Gateway, id: u8, answer: &Answer, reply: &mut Reply) {
    let lease_ms = gateway.settings.net.lease_ms;
    let moving = |reply: &mut Reply, what| say(reply, format_args!(" {what} lease_ms={lease_ms}"));
    match answer {
        Answer::Status(snapshot) => status::axis(gateway, id, snapshot, reply),
        Answer::Enabled(enabled) => say(reply, format_args!(" enabled={}", u8::from(*enabled))),
        Answer::Stopped => match gateway.axes.known(id) {
            Ok(Known::Pid(_) | Known::Cia402(_)) => say(reply, format_args!(" stopped=1")),
            _ => say(reply, format_args!(" jog_rpm=0")),
        },
        Answer::Jog(rpm) => moving(reply, format_args!("jog_rpm={rpm}")),
        Answer::Move(position) => moving(reply, format_args!("set_point={position}")),
        Answer::Homing => moving(reply, format_args!("homing=1")),
        Answer::Velocity(velocity) => moving(reply, format_args!("target_velocity={velocity}")),
        Answer::Torque(permille) => moving(reply, format_args!("target_torque_permille={permille}")),
        Answer::Mode(mode) => moving(reply, format_args!("mode={mode}")),
        Answer::Gains(gains) => {
            say(
                reply,
                format_args!(
                    " kp={} ki={} kd={}",
                    Decimal::from(gains.kp()),
                    Decimal::from(gains.ki()),
                    Decimal::from(gains.kd())
                ),
            );
        }
        Answer::Value(parameter, value) => {
            say(reply, format_args!(" {parameter}={value}"));
            if let Some(unit) = parameter.info().and_then(|info| info.unit) {
                say(reply, format_args!(" unit={unit}"));
            }
        }
        Answer::Written(parameter, value) => say(reply, format_args!(" {parameter}={value}")),
        Answer::Alarm(number) => {
            let text = puente_drives::edb::alarm_name(*number).unwrap_or(if *number == 0 {
                "none"
            } else {
                "undefined"
            });
            say(reply, format_args!(" alarm={number} text=\"{text}\""));
        }
        Answer::Cleared(alarm) => {
            say(reply, format_args!(" enabled=0"));
            if let Some(number) = alarm {
                say(reply, format_args!(" alarm={number}"));
            }
        }
    }
}

async fn group(gateway: &Gateway, by: Commander, set: Set, command: GroupCommand) -> Result<(), AxisError> {
    match command {
        GroupCommand::Start(goal) => gateway.axes.start_group(set, by, goal),
        GroupCommand::Stop => gateway.axes.stop_group(set, by, false).await,
        GroupCommand::Disable => gateway.axes.stop_group(set, by, true).await,
    }
}

/// Asks each unit for one register; whatever answers, if only with an exception, is there.
async fn scan(
    gateway: &Gateway,
    guest: Guest,
    bus: u8,
    (first, last): (u8, u8),
) -> Result<Units, (u8, Failure)> {
    let mut found = Units::default();
    for unit in first..=last {
        match probe(gateway, guest, bus, unit).await {
            Ok(()) => found.insert(unit),
            Err(Failure::NoReply(_)) => {}
            Err(failure) => return Err((unit, failure)),
        }
    }
    Ok(found)
}

async fn probe(gateway: &Gateway, guest: Guest, bus: u8, unit: u8) -> Result<(), Failure> {
    let address = puente_drives::edb::register::STATUS;
    let pdu = Request::ReadHoldingRegisters { address, quantity: 1 }.emit();
    let order = Order { seat: guest.seat, bus, unit, class: Class::Probe, pdu: &pdu };
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
            Mistake::Gain(_) => "range",
            Mistake::Object(_) => "object",
            Mistake::Type(_) => "type",
            Mistake::Mode(_) => "mode",
            Mistake::Unsupported(_) => "unsupported",
        }
    }
}
