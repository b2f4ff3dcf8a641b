//! Console commands, from text.

use core::fmt;
use core::str::FromStr;

use puente_canopen::{Address, NodeId, nmt};
use puente_drives::cia402::Mode;
use puente_drives::cia402::homing::Method;
use puente_drives::edb::Parameter;
use puente_drives::pid::{BadGain, Gains};

use super::super::dictionary::{Named, named};
use super::super::objects;
use crate::axis::group::Goal;
use crate::axis::{Course, cia402};

/// A command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Command<'a> {
    Help,
    Feed,
    System,
    Axes,
    Buses,
    Axis(&'a str, AxisCommand),
    Bus(&'a str, BusCommand),
    GroupStatus,
    /// Of axes, by their names with commas between them.
    Group(&'a str, GroupCommand),
    Nodes(&'a str),
    Node(&'a str, NodeId, NodeCommand<'a>),
}

/// What an axis is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::front) enum AxisCommand {
    Status,
    Enable,
    Disable,
    Stop,
    Alarm,
    Clear,
    /// In r/min.
    Jog(i32),
    /// In encoder counts, or in the drive's position and velocity units.
    Move(Course),
    /// By this method, or by the drive's own.
    Home(Option<Method>),
    /// In the drive's velocity units.
    Velocity(i32),
    /// In thousandths of the rated one.
    Torque(i16),
    Mode(Mode),
    Gains(Gains),
    Get(Parameter),
    Set(Parameter, u16),
}

/// What the axes of a group are to do, together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::front) enum GroupCommand {
    Start(Goal),
    Stop,
    Disable,
}

/// What a bus is to do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum BusCommand {
    Status,
    /// First and last unit.
    Scan((u8, u8)),
}

/// What a node of a CANopen bus is to do, or what it is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NodeCommand<'a> {
    Status,
    Emergencies,
    Nmt(nmt::Command),
    /// An object, in the type of its data sheet where none is said.
    Read(Address, Option<Named>),
    Write(Address, &'a str, Option<Named>),
}

/// What is wrong with a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Mistake<'a> {
    /// It is no text.
    Text,
    /// No such command.
    Unknown(&'a str),
    /// The command looks otherwise.
    Usage(&'static str),
    /// No parameter.
    Parameter(&'a str),
    /// No object.
    Object(&'a str),
    /// No data type.
    Type(&'a str),
    /// A gain that no loop can work with.
    Gain(BadGain),
    /// No mode of a CiA 402 drive.
    Mode(&'a str),
    /// No number, or none that is allowed here.
    Number(&'a str),
    /// A dialect that this version does not speak.
    Unsupported(&'static str),
}

impl fmt::Display for Mistake<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mistake::Text => f.write_str("the line has characters that are no printable ASCII"),
            Mistake::Unknown(word) => write!(f, "'{}' is no command; try 'help'", Shown(word)),
            Mistake::Usage(usage) => write!(f, "expected: {usage}"),
            Mistake::Parameter(word) => {
                write!(f, "'{}' is no parameter; write Pn and a number, as in Pn037", Shown(word))
            }
            Mistake::Object(word) => {
                write!(f, "'{}' is no object; write index and sub-index, as in 6041:0", Shown(word))
            }
            Mistake::Type(word) => {
                write!(f, "'{}' is no data type; 'help datatype' in CiA 309-3 has them", Shown(word))
            }
            Mistake::Gain(gain) => gain.fmt(f),
            Mistake::Mode(word) => {
                write!(f, "'{}' is no mode; pp, pv, pt, hm, ip, csp, csv, cst or its number is", Shown(word))
            }
            Mistake::Number(word) => write!(f, "'{}' is no number that is allowed here", Shown(word)),
            Mistake::Unsupported(dialect) => write!(f, "{dialect} is not spoken by this version"),
        }
    }
}

/// The beginning of a word, enough to recognise it.
struct Shown<'a>(&'a str);

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.get(..32) {
            Some(beginning) => write!(f, "{beginning}..."),
            None => f.write_str(self.0),
        }
    }
}

impl Command<'_> {
    /// Whether it stops an axis, which everyone may at any time.
    pub(super) fn stops(&self) -> bool {
        matches!(
            self,
            Command::Axis(_, AxisCommand::Stop | AxisCommand::Disable | AxisCommand::Jog(0))
                | Command::Group(_, GroupCommand::Stop | GroupCommand::Disable)
        )
    }

    /// Whether it moves an axis.
    pub(super) fn moves(&self) -> bool {
        match self {
            Command::Axis(_, AxisCommand::Jog(rpm)) => *rpm != 0,
            Command::Group(_, command) => matches!(command, GroupCommand::Start(_)),
            Command::Axis(_, command) => matches!(
                command,
                AxisCommand::Move(_)
                    | AxisCommand::Home(_)
                    | AxisCommand::Velocity(_)
                    | AxisCommand::Torque(_)
                    | AxisCommand::Mode(_)
            ),
            _ => false,
        }
    }
}

const AXIS: &str = "axis NAME status|enable|disable|stop|clear|move POSITION [VELOCITY]|\
home [METHOD]|velocity V|torque PERMILLE|mode MODE|gains KP KI KD|jog RPM|alarm|get PnNNN|set PnNNN VALUE";
const NODE: &str = "node BUS ID status|emcy|start|stop|preop|reset|reset-communication|\
read INDEX:SUB [TYPE]|write INDEX:SUB VALUE [TYPE]";
const BUS: &str = "bus NAME status|scan FIRST-LAST";

/// Reads a line that is not empty.
pub(super) fn parse(line: &[u8]) -> Result<Command<'_>, Mistake<'_>> {
    if !line.iter().all(|byte| byte.is_ascii_graphic() || matches!(byte, b' ' | b'\t')) {
        return Err(Mistake::Text);
    }
    let text = core::str::from_utf8(line).map_err(|_| Mistake::Text)?;
    let mut words = text.split_ascii_whitespace();
    let first = words.next().unwrap_or_default();
    let mut rest = [""; 6];
    let count = rest.iter_mut().zip(words.by_ref()).map(|(place, word)| *place = word).count();
    let rest = rest.get(..count).unwrap_or_default();
    if first.starts_with(['[', '0', '1', '2', '3', '4', '5', '6', '7', '8', '9']) {
        return Err(Mistake::Unsupported("CiA 309-3"));
    }
    if words.next().is_some() {
        return Err(Mistake::Usage("at most 7 words; try 'help'"));
    }
    match (first, rest) {
        ("help" | "?", []) => Ok(Command::Help),
        ("feed", []) => Ok(Command::Feed),
        ("system", []) => Ok(Command::System),
        ("axis", []) => Ok(Command::Axes),
        ("bus", []) => Ok(Command::Buses),
        ("group", [] | ["status"]) => Ok(Command::GroupStatus),
        ("group", [names, rest @ ..]) => Ok(Command::Group(names, group(rest)?)),
        ("axis", [name, rest @ ..]) => Ok(Command::Axis(name, axis(rest)?)),
        ("bus", [name, rest @ ..]) => Ok(Command::Bus(name, bus(rest)?)),
        ("node", [bus]) => Ok(Command::Nodes(bus)),
        ("node", [bus, id, rest @ ..]) => Ok(Command::Node(bus, node(id)?, node_command(rest)?)),
        ("node", []) => Err(Mistake::Usage("node BUS")),
        ("help" | "?" | "feed" | "system", _) => Err(Mistake::Usage("this word alone")),
        _ => Err(Mistake::Unknown(first)),
    }
}

fn axis<'a>(words: &[&'a str]) -> Result<AxisCommand, Mistake<'a>> {
    match words {
        ["status"] => Ok(AxisCommand::Status),
        ["enable"] => Ok(AxisCommand::Enable),
        ["disable"] => Ok(AxisCommand::Disable),
        ["stop"] => Ok(AxisCommand::Stop),
        ["alarm"] => Ok(AxisCommand::Alarm),
        ["clear"] => Ok(AxisCommand::Clear),
        ["jog", rpm] => number(rpm).map(AxisCommand::Jog),
        ["move", position] => Ok(AxisCommand::Move(Course { position: number(position)?, velocity: None })),
        ["move", position, velocity] => {
            let velocity = Some(number(velocity)?);
            Ok(AxisCommand::Move(Course { position: number(position)?, velocity }))
        }
        ["home"] => Ok(AxisCommand::Home(None)),
        ["home", method] => match number(method).map(Method::new)? {
            Some(method) => Ok(AxisCommand::Home(Some(method))),
            None => Err(Mistake::Number(method)),
        },
        ["velocity", velocity] => number(velocity).map(AxisCommand::Velocity),
        ["torque", torque] => number(torque).map(AxisCommand::Torque),
        ["mode", mode] => cia402::mode(mode).map(AxisCommand::Mode).ok_or(Mistake::Mode(mode)),
        ["gains", kp, ki, kd] => {
            let gains = Gains::new(number(kp)?, number(ki)?, number(kd)?);
            gains.map(AxisCommand::Gains).map_err(Mistake::Gain)
        }
        ["get", name] => parameter(name).map(AxisCommand::Get),
        ["set", name, value] => {
            Ok(AxisCommand::Set(parameter(name)?, word(value).ok_or(Mistake::Number(value))?))
        }
        _ => Err(Mistake::Usage(AXIS)),
    }
}

fn group<'a>(words: &[&'a str]) -> Result<GroupCommand, Mistake<'a>> {
    Ok(match words {
        ["enable"] => GroupCommand::Start(Goal::Enabled),
        ["home"] => GroupCommand::Start(Goal::Homed),
        ["start", mode] => GroupCommand::Start(Goal::In(cia402::mode(mode).ok_or(Mistake::Mode(mode))?)),
        ["stop"] => GroupCommand::Stop,
        ["disable"] => GroupCommand::Disable,
        _ => {
            return Err(Mistake::Usage(
                "group [status]|group NAME,NAME... enable|home|start MODE|stop|disable",
            ));
        }
    })
}

fn number<T: FromStr>(text: &str) -> Result<T, Mistake<'_>> {
    text.parse().map_err(|_| Mistake::Number(text))
}

fn parameter(name: &str) -> Result<Parameter, Mistake<'_>> {
    name.parse().map_err(|_| Mistake::Parameter(name))
}

/// A register's value: 0 to 65535, or -32768 to -1 as two's complement.
fn word(text: &str) -> Option<u16> {
    text.parse::<u16>().ok().or_else(|| text.parse::<i16>().ok().map(|value| value as u16))
}

fn bus<'a>(words: &[&'a str]) -> Result<BusCommand, Mistake<'a>> {
    match words {
        ["status"] => Ok(BusCommand::Status),
        ["scan", range] => scan(range).map(BusCommand::Scan).ok_or(Mistake::Number(range)),
        _ => Err(Mistake::Usage(BUS)),
    }
}

fn node(id: &str) -> Result<NodeId, Mistake<'_>> {
    id.parse().ok().and_then(NodeId::new).ok_or(Mistake::Number(id))
}

fn node_command<'a>(words: &[&'a str]) -> Result<NodeCommand<'a>, Mistake<'a>> {
    let address = |text| objects::address(text).ok_or(Mistake::Object(text));
    let kind = |name| named(name).map(Some).ok_or(Mistake::Type(name));
    Ok(match words {
        ["status"] => NodeCommand::Status,
        ["emcy"] => NodeCommand::Emergencies,
        ["read", object] => NodeCommand::Read(address(object)?, None),
        ["read", object, name] => NodeCommand::Read(address(object)?, kind(name)?),
        ["write", object, value] => NodeCommand::Write(address(object)?, value, None),
        ["write", object, value, name] => NodeCommand::Write(address(object)?, value, kind(name)?),
        [word] => NodeCommand::Nmt(objects::command(word).ok_or(Mistake::Usage(NODE))?),
        _ => return Err(Mistake::Usage(NODE)),
    })
}

/// Units 1 to 247, as in `1-16` or `7`.
fn scan(range: &str) -> Option<(u8, u8)> {
    let (first, last) = range.split_once('-').unwrap_or((range, range));
    let (first, last) = (first.parse::<u8>().ok()?, last.parse::<u8>().ok()?);
    (1 <= first && first <= last && last <= 247).then_some((first, last))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_read() {
        let gains = Gains::new(0.5, 2.0, 1e-3).expect("gains");
        let to = |axis, position, velocity| {
            Ok(Command::Axis(axis, AxisCommand::Move(Course { position, velocity })))
        };
        let pn037 = "Pn037".parse().expect("parameter");
        let cases: [(&[u8], Result<Command<'_>, Mistake<'_>>); 34] = [
            (b"group u,v home", Ok(Command::Group("u,v", GroupCommand::Start(Goal::Homed)))),
            (b"group u,v start fast", Err(Mistake::Mode("fast"))),
            (b"group", Ok(Command::GroupStatus)),
            (b"axis x move -1000", to("x", -1000, None)),
            (b"axis u move -1000 50", to("u", -1000, Some(50))),
            (b"axis u move -1000 -50", Err(Mistake::Number("-50"))),
            (b"axis u home", Ok(Command::Axis("u", AxisCommand::Home(None)))),
            (b"axis u home 35", Ok(Command::Axis("u", AxisCommand::Home(Method::new(35))))),
            (b"axis u home 300", Err(Mistake::Number("300"))),
            (b"axis u mode pv", Ok(Command::Axis("u", AxisCommand::Mode(Mode::ProfileVelocity)))),
            (b"axis u mode 5", Err(Mistake::Mode("5"))),
            (b"axis x move 1.5", Err(Mistake::Number("1.5"))),
            (b"axis x gains 0.5 2 1e-3", Ok(Command::Axis("x", AxisCommand::Gains(gains)))),
            (b"axis x gains 0.5 2 x", Err(Mistake::Number("x"))),
            (b"axis x gains 0.5 -2 0", Err(Mistake::Gain(BadGain { name: "ki", value: -2.0 }))),
            (b"axis x gains 0.5 2", Err(Mistake::Usage(AXIS))),
            (b"help", Ok(Command::Help)),
            (b"system", Ok(Command::System)),
            (b"system now", Err(Mistake::Usage("this word alone"))),
            (b"axis", Ok(Command::Axes)),
            (b"axis x jog -100", Ok(Command::Axis("x", AxisCommand::Jog(-100)))),
            (b"axis  x\tget pn037", Ok(Command::Axis("x", AxisCommand::Get(pn037)))),
            (b"axis x set Pn037 -1", Ok(Command::Axis("x", AxisCommand::Set(pn037, 0xFFFF)))),
            (b"axis x set Pn037 65535", Ok(Command::Axis("x", AxisCommand::Set(pn037, 0xFFFF)))),
            (b"axis x set Pn037 65536", Err(Mistake::Number("65536"))),
            (b"axis x jog fast", Err(Mistake::Number("fast"))),
            (b"axis x jog", Err(Mistake::Usage(AXIS))),
            (b"bus a scan 1-16", Ok(Command::Bus("a", BusCommand::Scan((1, 16))))),
            (b"bus a scan 9-3", Err(Mistake::Number("9-3"))),
            (b"bus a scan 0", Err(Mistake::Number("0"))),
            (b"go", Err(Mistake::Unknown("go"))),
            (b"axis x set Pn037 1 2 3 4", Err(Mistake::Usage("at most 7 words; try 'help'"))),
            (b"[1] 4 read 0x1017 0 i16", Err(Mistake::Unsupported("CiA 309-3"))),
            (b"axis \xFF", Err(Mistake::Text)),
        ];
        for (line, expected) in cases {
            assert_eq!(parse(line), expected, "{}", line.escape_ascii());
        }
    }

    #[test]
    fn what_stops_and_what_moves() {
        let jog = |rpm| Command::Axis("x", AxisCommand::Jog(rpm));
        assert!(jog(5).moves() && !jog(5).stops());
        assert!(jog(0).stops() && !jog(0).moves());
        assert!(Command::Axis("x", AxisCommand::Stop).stops());
        let group = |command| Command::Group("x,y", command);
        assert!(group(GroupCommand::Stop).stops() && !group(GroupCommand::Stop).moves());
        assert!(group(GroupCommand::Start(Goal::Enabled)).moves());
        let there = Course { position: 0, velocity: None };
        for command in [AxisCommand::Move(there), AxisCommand::Home(None), AxisCommand::Velocity(0)] {
            let command = Command::Axis("x", command);
            assert!(command.moves() && !command.stops());
        }
    }
}
