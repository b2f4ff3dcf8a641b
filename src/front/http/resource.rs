//! What has which path, and which methods it takes.

use heapless::Vec;

use super::head::Method;
use super::nodes::Path;
use super::page::{self, Asset};

/// What a path names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Resource<'p> {
    /// A file of the page.
    Asset(&'static Asset),
    /// `/api/axes`
    Axes,
    /// `/api/axes/NAME`
    Axis(&'p str),
    /// `/api/axes/NAME/COMMAND`
    Command(&'p str, Command),
    /// `/api/axes/NAME/gains`
    Gains(&'p str),
    /// `/api/axes/NAME/parameters/PARAMETER`
    Parameter(&'p str, &'p str),
    /// `/api/group`
    Group,
    /// `/api/buses`
    Buses,
    /// `/api/buses/NAME/nodes` and what is under it
    Nodes(&'p str, Path<'p>),
    /// `/api/system`
    System,
    /// `/api/log`
    Log,
    /// `/metrics`
    Metrics,
    /// `/api/config`
    Config,
    /// `/api/config/confirm`
    Confirm,
    /// `/api/config/state`
    ConfigState,
}

/// What an axis can be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    Jog,
    Move,
    Home,
    Velocity,
    Torque,
    Mode,
    Stop,
    Enable,
    Disable,
    Clear,
}

impl<'p> Resource<'p> {
    pub(super) fn find(path: &'p str) -> Option<Self> {
        let mut segments = Vec::<_, 8>::new();
        for segment in path.strip_prefix('/')?.split('/') {
            segments.push(segment).ok()?;
        }
        Some(match *segments {
            ["api", "axes"] => Resource::Axes,
            ["api", "axes", axis] => Resource::Axis(axis),
            ["api", "axes", axis, "gains"] => Resource::Gains(axis),
            ["api", "axes", axis, command] => Resource::Command(axis, Command::find(command)?),
            ["api", "axes", axis, "parameters", parameter] => Resource::Parameter(axis, parameter),
            ["api", "group"] => Resource::Group,
            ["api", "buses"] => Resource::Buses,
            ["api", "buses", bus, "nodes", ref rest @ ..] => Resource::Nodes(bus, Path::find(rest)?),
            ["api", "config"] => Resource::Config,
            ["api", "config", "confirm"] => Resource::Confirm,
            ["api", "config", "state"] => Resource::ConfigState,
            ["api", "system"] => Resource::System,
            ["api", "log"] => Resource::Log,
            ["metrics"] => Resource::Metrics,
            [name] => Resource::Asset(page::asset(name)?),
            _ => return None,
        })
    }

    /// The methods it takes, as in the header field `Allow`.
    pub(super) const fn methods(&self) -> &'static str {
        match self {
            Resource::Command(..) | Resource::Confirm => "POST",
            Resource::Gains(_) | Resource::Parameter(..) => "GET, HEAD, PUT",
            Resource::Config => "GET, HEAD, PUT, DELETE",
            Resource::Nodes(_, path) => path.methods(),
            Resource::Asset(_)
            | Resource::Axes
            | Resource::Axis(_)
            | Resource::Group
            | Resource::Buses
            | Resource::System
            | Resource::Log
            | Resource::Metrics
            | Resource::ConfigState => "GET, HEAD",
        }
    }

    pub(super) const fn takes(&self, method: Method) -> bool {
        if let Resource::Nodes(_, path) = self {
            return path.takes(method);
        }
        match method {
            Method::Get | Method::Head => !matches!(self, Resource::Command(..) | Resource::Confirm),
            Method::Post => matches!(self, Resource::Command(..) | Resource::Confirm),
            Method::Put => matches!(self, Resource::Gains(_) | Resource::Parameter(..) | Resource::Config),
            Method::Delete => matches!(self, Resource::Config),
            Method::Other => false,
        }
    }

    /// Whether it can only bring an axis to rest, which is allowed to everyone.
    pub(super) const fn stops(&self) -> bool {
        matches!(self, Resource::Command(_, Command::Stop | Command::Disable))
    }
}

impl Command {
    fn find(name: &str) -> Option<Self> {
        Some(match name {
            "jog" => Command::Jog,
            "move" => Command::Move,
            "home" => Command::Home,
            "velocity" => Command::Velocity,
            "torque" => Command::Torque,
            "mode" => Command::Mode,
            "stop" => Command::Stop,
            "enable" => Command::Enable,
            "disable" => Command::Disable,
            "clear" => Command::Clear,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use puente_canopen::nmt;

    use super::*;

    #[test]
    fn paths() {
        for (path, expected) in [
            ("/api/axes", Resource::Axes),
            ("/api/axes/x", Resource::Axis("x")),
            ("/api/axes/", Resource::Axis("")),
            ("/api/axes/x/jog", Resource::Command("x", Command::Jog)),
            ("/api/axes/x/move", Resource::Command("x", Command::Move)),
            ("/api/axes/x/home", Resource::Command("x", Command::Home)),
            ("/api/axes/x/mode", Resource::Command("x", Command::Mode)),
            ("/api/axes/x/gains", Resource::Gains("x")),
            ("/api/axes/x/stop", Resource::Command("x", Command::Stop)),
            ("/api/axes/x/parameters/Pn037", Resource::Parameter("x", "Pn037")),
            ("/api/buses", Resource::Buses),
            ("/api/buses/can/nodes", Resource::Nodes("can", Path::All)),
            ("/api/buses/can/nodes/5", Resource::Nodes("can", Path::Node("5"))),
            ("/api/buses/can/nodes/0/start", Resource::Nodes("can", Path::Command("0", nmt::Command::Start))),
            ("/api/buses/can/nodes/5/emergencies", Resource::Nodes("can", Path::Emergencies("5"))),
            ("/api/buses/can/nodes/5/eds", Resource::Nodes("can", Path::Sheet("5"))),
            ("/api/buses/can/nodes/5/objects", Resource::Nodes("can", Path::Objects("5"))),
            (
                "/api/buses/can/nodes/5/objects/6041:0",
                Resource::Nodes("can", Path::Object("5", "6041:0", None)),
            ),
            (
                "/api/buses/can/nodes/5/objects/6041/u16",
                Resource::Nodes("can", Path::Object("5", "6041", Some("u16"))),
            ),
            ("/api/config", Resource::Config),
            ("/api/config/confirm", Resource::Confirm),
            ("/api/config/state", Resource::ConfigState),
            ("/api/system", Resource::System),
            ("/api/log", Resource::Log),
            ("/metrics", Resource::Metrics),
            ("/", Resource::Asset(&page::INDEX)),
        ] {
            assert_eq!(Resource::find(path), Some(expected), "{path}");
        }
        for path in [
            "",
            "*",
            "api/axes",
            "/api",
            "/api/",
            "/api/axes/x/fly",
            "/api/axes/x/parameters",
            "//",
            "/x",
            "/api/axes/x/parameters/Pn037/x",
            "/../metrics",
            "/api/buses/can",
            "/api/buses/can/nodes/5/jog",
            "/api/buses/can/nodes/5/objects/6041/u16/x",
        ] {
            assert_eq!(Resource::find(path), None, "{path}");
        }
    }

    #[test]
    fn methods_are_those_listed() {
        let names = [
            ("GET", Method::Get),
            ("HEAD", Method::Head),
            ("POST", Method::Post),
            ("PUT", Method::Put),
            ("DELETE", Method::Delete),
        ];
        for path in [
            "/",
            "/api/axes",
            "/api/axes/x",
            "/api/axes/x/jog",
            "/api/axes/x/gains",
            "/api/axes/x/parameters/a",
            "/api/buses",
            "/api/buses/can/nodes",
            "/api/buses/can/nodes/5/stop",
            "/api/buses/can/nodes/5/eds",
            "/api/buses/can/nodes/5/objects",
            "/api/buses/can/nodes/5/objects/6041",
            "/api/config",
            "/api/config/confirm",
            "/api/config/state",
            "/api/system",
            "/api/log",
            "/metrics",
        ] {
            let resource = Resource::find(path).expect("a path");
            assert!(!resource.takes(Method::Other));
            for (name, method) in names {
                let listed = resource.methods().split(", ").any(|listed| listed == name);
                assert_eq!(resource.takes(method), listed, "{path} {name}");
            }
        }
    }

    #[test]
    fn only_stop_and_disable_stop() {
        let stops = |command| Resource::Command("x", command).stops();
        assert!(stops(Command::Stop) && stops(Command::Disable));
        assert!(!stops(Command::Move) && !stops(Command::Velocity) && !stops(Command::Mode));
        assert!(!stops(Command::Jog) && !stops(Command::Enable) && !stops(Command::Clear));
        assert!(!Resource::Axes.stops());
    }
}
