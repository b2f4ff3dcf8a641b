//! What is wrong with a document whose types are right.

use core::fmt;
use core::net::Ipv4Addr;

use puente_drives::cia402::homing::Method;
use puente_drives::cia402::{Mode, Period};
use puente_drives::pid::Gains;
use puente_line::Duration;

use super::{Axis, Bus, Cia402, Drive, Edb, Name, Net, Node, Pid, Protocol, Settings, VERSION};
use crate::port::limits::{CANOPEN, CLIENTS, CLIENTS_ALLOWED, DRIVES, FRAMED, MEMBERS};
use crate::port::{self, BadPort};

/// What is wrong with a document whose types are right, and where.
#[derive(Clone, Debug, PartialEq)]
pub enum Problem {
    /// The document is of another version.
    Version(u32),
    /// A value of `[net]` is out of range.
    Net {
        /// The key.
        key: &'static str,
        /// What is allowed.
        allowed: &'static str,
    },
    /// There is no bus.
    NoBus,
    /// A value of a bus is out of range.
    Bus {
        /// Which bus.
        name: Name,
        /// The key.
        key: &'static str,
        /// What is allowed.
        allowed: &'static str,
    },
    /// There is no such line, or it cannot do what it is to do.
    Port {
        /// Which bus.
        name: Name,
        /// Why.
        error: BadPort,
    },
    /// A value of an axis is out of range.
    Axis {
        /// Which axis.
        name: Name,
        /// The key.
        key: &'static str,
        /// What is allowed.
        allowed: &'static str,
    },
    /// There are more framed buses than the gateway can have.
    FramedBuses {
        /// The first that is too many.
        name: Name,
    },
    /// There are more CANopen buses than the gateway can have.
    CanopenBuses {
        /// The first that is too many.
        name: Name,
    },
    /// A CANopen bus has more axes than the gateway can drive there.
    Drives {
        /// Which bus.
        name: Name,
    },
    /// A CANopen bus has more nodes, those of axes among them, than the gateway can watch there.
    Members {
        /// Which bus.
        name: Name,
    },
    /// Two CANopen buses have the same network number.
    SameNet {
        /// The second bus.
        name: Name,
        /// The first bus.
        other: Name,
        /// The number.
        net: u16,
    },
    /// A value of a node is out of range.
    Node {
        /// The bus that it names.
        bus: Name,
        /// Which node of that.
        id: u8,
        /// The key.
        key: &'static str,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A node names a bus that does not exist, or is no CANopen bus.
    NodeBus {
        /// The bus that it names.
        bus: Name,
        /// Which node.
        id: u8,
    },
    /// Two buses serve the same unit.
    Overlap {
        /// The second bus.
        name: Name,
        /// The first bus.
        other: Name,
        /// The unit.
        unit: u8,
    },
    /// Two buses have the same port.
    SamePort {
        /// The second bus.
        name: Name,
        /// The first bus.
        other: Name,
    },
    /// An axis names a bus that does not exist.
    UnknownBus {
        /// Which axis.
        axis: Name,
        /// The bus it names.
        bus: Name,
    },
    /// Two of the registers that the gateway writes are one.
    SameRegister {
        /// Which axis.
        axis: Name,
        /// The register.
        register: u16,
    },
    /// Two axes have the same drive.
    SameDrive {
        /// The second axis.
        axis: Name,
        /// The first axis.
        other: Name,
    },
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::Version(version) => {
                write!(f, "version: {version} is not known, this firmware reads version {VERSION}")
            }
            Problem::Net { key, allowed } => write!(f, "[net] {key}: {allowed}"),
            Problem::NoBus => f.write_str("no [[bus]] is given"),
            Problem::Bus { name, key, allowed } => write!(f, "[[bus]] \"{name}\" {key}: {allowed}"),
            Problem::Port { name, error } => write!(f, "[[bus]] \"{name}\" port: {error}"),
            Problem::Axis { name, key, allowed } => write!(f, "[[axis]] \"{name}\" {key}: {allowed}"),
            Problem::FramedBuses { name } => {
                write!(f, "[[bus]] \"{name}\" protocol: at most {FRAMED} can be framed")
            }
            Problem::CanopenBuses { name } => {
                write!(f, "[[bus]] \"{name}\" protocol: at most {CANOPEN} can be CANopen")
            }
            Problem::Drives { name } => write!(f, "[[bus]] \"{name}\": at most {DRIVES} axes can be there"),
            Problem::Members { name } => {
                write!(f, "[[bus]] \"{name}\": at most {MEMBERS} nodes, with those of axes, can be there")
            }
            Problem::SameNet { name, other, net } => {
                write!(f, "[[bus]] \"{name}\" net: bus \"{other}\" has number {net} already")
            }
            Problem::Node { bus, id, key, allowed } => {
                write!(f, "[[node]] {id} of \"{bus}\" {key}: {allowed}")
            }
            Problem::NodeBus { bus, id } => {
                write!(f, "[[node]] {id} of \"{bus}\" bus: there is no CANopen [[bus]] \"{bus}\"")
            }
            Problem::Overlap { name, other, unit } => {
                write!(f, "[[bus]] \"{name}\" units: bus \"{other}\" serves unit {unit} already")
            }
            Problem::SamePort { name, other } => {
                write!(f, "[[bus]] \"{name}\" port: bus \"{other}\" has this port already")
            }
            Problem::SameRegister { axis, register } => {
                write!(f, "[[axis]] \"{axis}\" registers: {register:04X}h is given two meanings")
            }
            Problem::UnknownBus { axis, bus } => {
                write!(f, "[[axis]] \"{axis}\" bus: there is no [[bus]] \"{bus}\"")
            }
            Problem::SameDrive { axis, other } => {
                write!(f, "[[axis]] \"{axis}\" address: axis \"{other}\" has this drive already")
            }
        }
    }
}

/// The port of which there are as many as one likes.
const SIMULATED: &str = "sim";
const NODE_IDS: core::ops::RangeInclusive<u8> = 1..=127;
const NODE_IDS_ALLOWED: &str = "1 to 127 is allowed";
const NAMES: &str = "a unique name of letters, digits, '-' and '_' is needed";

fn is_name(name: &str) -> bool {
    !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_".contains(&byte))
}

impl Settings {
    /// Finds what the types do not: ranges, unique names, references, and what the port's lines cannot do.
    pub fn check(&self) -> Result<(), Problem> {
        if self.version != VERSION {
            return Err(Problem::Version(self.version));
        }
        self.net.check()?;
        if self.buses.is_empty() {
            return Err(Problem::NoBus);
        }
        for (index, bus) in self.buses.iter().enumerate() {
            let before = self.buses.iter().take(index);
            if !is_name(&bus.name) || before.clone().any(|other| other.name == bus.name) {
                return Err(Problem::Bus { name: bus.name.clone(), key: "name", allowed: NAMES });
            }
            bus.check()?;
            for other in before {
                if other.port == bus.port && bus.port != SIMULATED {
                    return Err(Problem::SamePort { name: bus.name.clone(), other: other.name.clone() });
                }
                let nets = other.canopen().zip(bus.canopen()).filter(|(other, bus)| other.net == bus.net);
                if let Some((_, canopen)) = nets {
                    let (name, other) = (bus.name.clone(), other.name.clone());
                    return Err(Problem::SameNet { name, other, net: canopen.net });
                }
                let units = other.modbus().zip(bus.modbus());
                if let Some(unit) = units.and_then(|(other, bus)| other.units.overlap(&bus.units)) {
                    return Err(Problem::Overlap { name: bus.name.clone(), other: other.name.clone(), unit });
                }
            }
        }
        if let Some(bus) = self.buses.iter().filter(|bus| bus.framed().is_some()).nth(FRAMED) {
            return Err(Problem::FramedBuses { name: bus.name.clone() });
        }
        if let Some(bus) = self.buses.iter().filter(|bus| bus.canopen().is_some()).nth(CANOPEN) {
            return Err(Problem::CanopenBuses { name: bus.name.clone() });
        }
        for (index, axis) in self.axes.iter().enumerate() {
            self.check_axis(axis, self.axes.get(..index).unwrap_or_default())?;
        }
        for (index, node) in self.nodes.iter().enumerate() {
            self.check_node(node, self.nodes.get(..index).unwrap_or_default())?;
        }
        self.buses.iter().filter(|bus| bus.canopen().is_some()).try_for_each(|bus| self.check_members(bus))
    }

    fn check_members(&self, bus: &Bus) -> Result<(), Problem> {
        let axes = || self.axes.iter().filter(|axis| axis.bus == bus.name);
        let plain = |node: &&Node| node.bus == bus.name && axes().all(|axis| axis.address != node.id);
        let drives = axes().count();
        if drives > DRIVES {
            return Err(Problem::Drives { name: bus.name.clone() });
        }
        if drives + self.nodes.iter().filter(plain).count() > MEMBERS {
            return Err(Problem::Members { name: bus.name.clone() });
        }
        Ok(())
    }

    fn check_node(&self, node: &Node, before: &[Node]) -> Result<(), Problem> {
        let bus = self.buses.iter().find(|bus| bus.name == node.bus).and_then(Bus::canopen);
        let bus = bus.ok_or_else(|| Problem::NodeBus { bus: node.bus.clone(), id: node.id })?;
        let problem =
            |(key, allowed)| Err(Problem::Node { bus: node.bus.clone(), id: node.id, key, allowed });
        if !NODE_IDS.contains(&node.id) {
            return problem(("id", NODE_IDS_ALLOWED));
        }
        if node.id == bus.node {
            return problem(("id", "it must differ from the node of the bus, which is the gateway itself"));
        }
        if before.iter().any(|other| other.bus == node.bus && other.id == node.id) {
            return problem(("id", "another [[node]] is this one already"));
        }
        if node.name.as_ref().is_some_and(|name| !is_name(name)) {
            return problem(("name", "letters, digits, '-' and '_' are allowed"));
        }
        node.check().or_else(problem)
    }

    fn check_axis(&self, axis: &Axis, before: &[Axis]) -> Result<(), Problem> {
        let problem = |key, allowed| Err(Problem::Axis { name: axis.name.clone(), key, allowed });
        if !is_name(&axis.name) || before.iter().any(|other| other.name == axis.name) {
            return problem("name", NAMES);
        }
        let Some(bus) = self.buses.iter().find(|bus| bus.name == axis.bus) else {
            return Err(Problem::UnknownBus { axis: axis.name.clone(), bus: axis.bus.clone() });
        };
        if let Some(key) = axis.stray {
            return problem(key, "this drive has no such key");
        }
        match (&axis.drive, &bus.protocol) {
            (Drive::Edb(_), Protocol::ModbusRtu(_) | Protocol::ModbusAscii(_)) => {
                if !(1..=247).contains(&axis.address) {
                    return problem("address", "1 to 247 is allowed");
                }
            }
            (Drive::Pid(_), Protocol::Framed(framed)) => {
                if !(1..=254).contains(&axis.address) {
                    return problem("address", "1 to 254 is allowed");
                }
                if axis.address == framed.station {
                    const OWN: &str =
                        "it must differ from the station of the bus, which is the gateway itself";
                    return problem("address", OWN);
                }
            }
            (Drive::Cia402(_), Protocol::Canopen(canopen)) => {
                if !NODE_IDS.contains(&axis.address) {
                    return problem("address", NODE_IDS_ALLOWED);
                }
                if axis.address == canopen.node {
                    const OWN: &str = "it must differ from the node of the bus, which is the gateway itself";
                    return problem("address", OWN);
                }
            }
            (_, Protocol::ModbusRtu(_) | Protocol::ModbusAscii(_)) => {
                return problem("drive", "\"edb\" is what a Modbus bus can have");
            }
            (_, Protocol::Framed(_)) => return problem("drive", "\"pid\" is what a framed bus can have"),
            (_, Protocol::Canopen(_)) => {
                return problem("drive", "\"cia402\" is what a CANopen bus can have");
            }
        }
        if let Some(other) =
            before.iter().find(|other| other.bus == axis.bus && other.address == axis.address)
        {
            return Err(Problem::SameDrive { axis: axis.name.clone(), other: other.name.clone() });
        }
        match &axis.drive {
            Drive::Edb(edb) => edb.check(&axis.name),
            Drive::Pid(pid) => pid.check(&axis.name),
            Drive::Cia402(cia402) => cia402.check(&axis.name, bus.canopen().map_or(0, |bus| bus.sync_us)),
        }
    }
}

impl Edb {
    fn check(&self, axis: &Name) -> Result<(), Problem> {
        if self.max_rpm == 0 || self.max_rpm > i16::MAX as u16 {
            return Err(Problem::Axis {
                name: axis.clone(),
                key: "max_rpm",
                allowed: "1 to 32767 is allowed",
            });
        }
        match self.registers.written_twice() {
            Some(register) => Err(Problem::SameRegister { axis: axis.clone(), register }),
            None => Ok(()),
        }
    }
}

impl Pid {
    fn check(&self, axis: &Name) -> Result<(), Problem> {
        match self.gains {
            Some([kp, ki, kd]) if Gains::new(kp, ki, kd).is_err() => Err(Problem::Axis {
                name: axis.clone(),
                key: "gains",
                allowed: "three numbers from 0 to 1000000 are needed: Kp, Ki and Kd",
            }),
            Some(_) | None => Ok(()),
        }
    }
}

impl Cia402 {
    fn check(&self, axis: &Name, sync_us: u32) -> Result<(), Problem> {
        if self.homing.is_some_and(|method| Method::new(method).is_none()) {
            return Err(Problem::Axis {
                name: axis.clone(),
                key: "homing",
                allowed: "a method of CiA 402 is needed: -128 to -1, 1 to 14, 17 to 30, 33 to 35 or 37",
            });
        }
        let positive = [
            ("homing_fast", self.homing_fast),
            ("homing_slow", self.homing_slow),
            ("homing_acceleration", self.homing_acceleration),
            ("max_velocity", self.max_velocity),
        ];
        if let Some((key, _)) = positive.into_iter().find(|(_, value)| *value == Some(0)) {
            return Err(Problem::Axis { name: axis.clone(), key, allowed: "it must be above 0" });
        }
        match self.cyclic.and_then(|mode| self.lacks(mode, sync_us)) {
            Some(allowed) => Err(Problem::Axis { name: axis.clone(), key: "cyclic", allowed }),
            None => Ok(()),
        }
    }

    /// What is in the way of a cyclic mode.
    fn lacks(&self, mode: Mode, sync_us: u32) -> Option<&'static str> {
        if !self.profile.has(mode) {
            return Some("the profile has no such mode");
        }
        if sync_us == 0 {
            return Some("the bus needs a sync_us above 0 for it");
        }
        let period = Period::new(Duration::from_micros(sync_us.into()));
        period.is_none().then_some("sync_us of the bus must be 1 to 255 times a power of ten for it")
    }
}

impl Net {
    fn check(&self) -> Result<(), Problem> {
        let problem = |key, allowed| Err(Problem::Net { key, allowed });
        if !(1..=CLIENTS).contains(&usize::from(self.clients)) {
            return problem("clients", CLIENTS_ALLOWED);
        }
        if !(50..=5000).contains(&self.lease_ms) {
            return problem("lease_ms", "50 to 5000 is allowed");
        }
        if !(5..=86_400).contains(&self.idle_s) {
            return problem("idle_s", "5 to 86400 is allowed");
        }
        if self.port == self.modbus_port && self.port != 0 {
            return problem("modbus_port", "it must differ from port");
        }
        for (key, port, others) in [
            ("slcan_port", self.slcan_port, [self.port, self.modbus_port, 0]),
            ("socketcand_port", self.socketcand_port, [self.port, self.modbus_port, self.slcan_port]),
        ] {
            if port != 0 && others.contains(&port) {
                return problem(key, "it must differ from the other ports");
            }
        }
        if !(1..=30).contains(&self.address.prefix) {
            return problem("address", "1 to 30 bits of the network part are allowed");
        }
        if !is_host(self.address.address) || !self.address.has_host(self.address.address) {
            return problem("address", "it must be one that a host can have");
        }
        if self.router.is_some_and(|router| router == self.address.address || !self.address.has_host(router))
        {
            return problem("router", "it must be another host of the network of address");
        }
        if !is_label(&self.hostname) {
            return problem(
                "hostname",
                "1 to 32 letters, digits and '-' are allowed, '-' neither first nor last",
            );
        }
        Ok(())
    }
}

/// Whether a host can have this address: it is not this host itself, a loopback, multicast or reserved one (RFC 6890).
fn is_host(address: Ipv4Addr) -> bool {
    !matches!(address.octets(), [0 | 127 | 224.., ..])
}

/// A label of a host's name (RFC 1123, section 2.1); the type limits its length.
fn is_label(name: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-';
    !name.is_empty() && name.bytes().all(allowed) && !name.starts_with('-') && !name.ends_with('-')
}

impl Bus {
    fn check(&self) -> Result<(), Problem> {
        let problem = |(key, allowed)| Problem::Bus { name: self.name.clone(), key, allowed };
        if let Some(key) = self.stray {
            return Err(problem((key, "this protocol has no such key")));
        }
        if let Some(line) = self.line() {
            if !(300..=1_000_000).contains(&line.baud) {
                return Err(problem(("baud", "300 to 1000000 is allowed")));
            }
            if line.format.data_bits == 7 {
                match self.protocol {
                    Protocol::ModbusRtu(_) => {
                        return Err(problem(("format", "Modbus RTU needs 8 data bits")));
                    }
                    Protocol::Framed(_) => return Err(problem(("format", "a framed bus needs 8 data bits"))),
                    Protocol::ModbusAscii(_) | Protocol::Canopen(_) => {}
                }
            }
        }
        let port = match &self.protocol {
            Protocol::ModbusRtu(modbus) | Protocol::ModbusAscii(modbus) => {
                modbus.check().map_err(problem)?;
                port::check_line(&self.port, modbus.line)
            }
            Protocol::Framed(framed) => {
                framed.check().map_err(problem)?;
                port::check_line(&self.port, framed.line)
            }
            Protocol::Canopen(canopen) => {
                canopen.check().map_err(problem)?;
                port::check_can(&self.port, canopen.bitrate)
            }
        };
        port.map_err(|error| Problem::Port { name: self.name.clone(), error })
    }
}

/// A key, and what is allowed.
pub(super) type Range = (&'static str, &'static str);
