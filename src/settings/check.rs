//! What is wrong with a document whose types are right.

use core::fmt;
use core::net::Ipv4Addr;

use super::{Axis, Bus, Name, Net, Protocol, Settings, VERSION};
use crate::port::limits::{CLIENTS, CLIENTS_ALLOWED};
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
                if let Some(unit) = other.units.overlap(&bus.units) {
                    return Err(Problem::Overlap { name: bus.name.clone(), other: other.name.clone(), unit });
                }
            }
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
        if !self.buses.iter().any(|bus| bus.name == axis.bus) {
            return Err(Problem::UnknownBus { axis: axis.name.clone(), bus: axis.bus.clone() });
        }
        if !(1..=247).contains(&axis.address) {
            return problem("address", "1 to 247 is allowed");
        }
        if let Some(other) =
            before.iter().find(|other| other.bus == axis.bus && other.address == axis.address)
        {
            return Err(Problem::SameDrive { axis: axis.name.clone(), other: other.name.clone() });
        }
        if axis.max_rpm == 0 || axis.max_rpm > i16::MAX as u16 {
            return problem("max_rpm", "1 to 32767 is allowed");
        }
        match axis.registers.written_twice() {
            Some(register) => Err(Problem::SameRegister { axis: axis.name.clone(), register }),
            None => Ok(()),
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
        let problem = |key, allowed| Err(Problem::Bus { name: self.name.clone(), key, allowed });
        let ascii_only = self.protocol == Protocol::ModbusRtu && self.format.data_bits == 7;
        if !(300..=1_000_000).contains(&self.baud) {
            return problem("baud", "300 to 1000000 is allowed");
        }
        if ascii_only {
            return problem("format", "Modbus RTU needs 8 data bits");
        }
        if !(5..=60_000).contains(&self.reply_timeout_ms) {
            return problem("reply_timeout_ms", "5 to 60000 is allowed");
        }
        if self.turnaround_ms > 10_000 {
            return problem("turnaround_ms", "0 to 10000 is allowed");
        }
        if self.rest_ms > 10_000 {
            return problem("rest_ms", "0 to 10000 is allowed");
        }
        if self.quarantine_ms.is_some_and(|ms| ms > 60_000) {
            return problem("quarantine_ms", "0 to 60000 is allowed");
        }
        if !(50..=60_000).contains(&self.queue_timeout_ms) {
            return problem("queue_timeout_ms", "50 to 60000 is allowed");
        }
        let line = puente_line::Settings { baud: self.baud, format: self.format };
        port::check_line(&self.port, line).map_err(|error| Problem::Port { name: self.name.clone(), error })
    }
}
