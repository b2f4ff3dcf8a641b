//! What is wrong with a document whose types are right.

use core::fmt;
use core::net::Ipv4Addr;

use puente_drives::pid::Gains;

use super::{Axis, Bus, Drive, Echo, Edb, Framed, Modbus, Name, Net, Pid, Protocol, Settings, VERSION};
use crate::port::limits::{CLIENTS, CLIENTS_ALLOWED, FRAMED};
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
                let units = other.modbus().zip(bus.modbus());
                if let Some(unit) = units.and_then(|(other, bus)| other.units.overlap(&bus.units)) {
                    return Err(Problem::Overlap { name: bus.name.clone(), other: other.name.clone(), unit });
                }
            }
        }
        if let Some(bus) = self.buses.iter().filter(|bus| bus.framed().is_some()).nth(FRAMED) {
            return Err(Problem::FramedBuses { name: bus.name.clone() });
        }
        for (index, axis) in self.axes.iter().enumerate() {
            self.check_axis(axis, self.axes.get(..index).unwrap_or_default())?;
        }
        Ok(())
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
        match (&axis.drive, bus.framed()) {
            (Drive::Edb(_), Some(_)) => return problem("drive", "\"pid\" is what a framed bus can have"),
            (Drive::Pid(_), None) => return problem("drive", "\"edb\" is what a Modbus bus can have"),
            (Drive::Edb(_), None) if !(1..=247).contains(&axis.address) => {
                return problem("address", "1 to 247 is allowed");
            }
            (Drive::Pid(_), Some(_)) if !(1..=254).contains(&axis.address) => {
                return problem("address", "1 to 254 is allowed");
            }
            (Drive::Pid(_), Some(framed)) if axis.address == framed.station => {
                return problem(
                    "address",
                    "it must differ from the station of the bus, which is the gateway itself",
                );
            }
            (Drive::Edb(_), None) | (Drive::Pid(_), Some(_)) => {}
        }
        if let Some(other) =
            before.iter().find(|other| other.bus == axis.bus && other.address == axis.address)
        {
            return Err(Problem::SameDrive { axis: axis.name.clone(), other: other.name.clone() });
        }
        match &axis.drive {
            Drive::Edb(edb) => edb.check(&axis.name),
            Drive::Pid(pid) => pid.check(&axis.name),
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
        if !(300..=1_000_000).contains(&self.baud) {
            return Err(problem(("baud", "300 to 1000000 is allowed")));
        }
        match (&self.protocol, self.format.data_bits) {
            (Protocol::ModbusRtu(_), 7) => return Err(problem(("format", "Modbus RTU needs 8 data bits"))),
            (Protocol::Framed(_), 7) => return Err(problem(("format", "a framed bus needs 8 data bits"))),
            (Protocol::ModbusRtu(modbus) | Protocol::ModbusAscii(modbus), _) => modbus.check(),
            (Protocol::Framed(framed), _) => framed.check(),
        }
        .map_err(problem)?;
        let line = puente_line::Settings { baud: self.baud, format: self.format };
        port::check_line(&self.port, line).map_err(|error| Problem::Port { name: self.name.clone(), error })
    }
}

/// A key, and what is allowed.
type Range = (&'static str, &'static str);

impl Modbus {
    fn check(&self) -> Result<(), Range> {
        if !(5..=60_000).contains(&self.reply_timeout_ms) {
            return Err(("reply_timeout_ms", "5 to 60000 is allowed"));
        }
        if self.turnaround_ms > 10_000 {
            return Err(("turnaround_ms", "0 to 10000 is allowed"));
        }
        if self.rest_ms > 10_000 {
            return Err(("rest_ms", "0 to 10000 is allowed"));
        }
        if self.quarantine_ms.is_some_and(|ms| ms > 60_000) {
            return Err(("quarantine_ms", "0 to 60000 is allowed"));
        }
        if !(50..=60_000).contains(&self.queue_timeout_ms) {
            return Err(("queue_timeout_ms", "50 to 60000 is allowed"));
        }
        Ok(())
    }
}

impl Framed {
    fn check(&self) -> Result<(), Range> {
        if !(1..=254).contains(&self.station) {
            return Err(("station", "1 to 254 is allowed"));
        }
        if !(1..=1000).contains(&self.cycle_ms) {
            return Err(("cycle_ms", "1 to 1000 is allowed"));
        }
        if !(1..=1000).contains(&self.ipg) {
            return Err(("ipg", "1 to 1000 characters are allowed"));
        }
        if !(1..=1000).contains(&self.slot) {
            return Err(("slot", "1 to 1000 characters are allowed"));
        }
        if !(1..=16).contains(&self.attempts) {
            return Err(("attempts", "1 to 16 is allowed"));
        }
        if !(1..=8).contains(&self.window) {
            return Err(("window", "1 to 8 is allowed"));
        }
        if self.echo == Echo::Strip {
            return Err(("echo", "\"verify\" or \"off\" is what a framed bus can have"));
        }
        Ok(())
    }
}
