//! The settings: one document, TOML in a file, JSON over HTTP, compact in flash. Unknown keys are errors;
//! [`Settings::check`] finds what the types cannot.

mod check;
mod cidr;
mod document;
pub mod json;
pub mod keeper;
pub mod record;
pub mod store;

use core::fmt;
use core::net::Ipv4Addr;
use core::str::FromStr;

use heapless::{String, Vec};
use puente_drives::edb::Registers;
use puente_line::Format;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::desk::Units;
pub use check::Problem;
pub use cidr::{BadCidr, Cidr};

use crate::port::defaults;
use crate::port::limits::{AXES, BUSES};

/// The version of the document's keys that this firmware reads and writes.
pub const VERSION: u32 = 1;

/// A name of a bus or an axis.
pub type Name = String<16>;

/// The whole document.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Version of the keys, [`VERSION`].
    pub version: u32,
    /// TCP side.
    pub net: Net,
    /// The buses.
    #[serde(rename = "bus")]
    pub buses: Vec<Bus, BUSES>,
    /// The axes.
    #[serde(rename = "axis")]
    pub axes: Vec<Axis, AXES>,
}

/// TCP side.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Net {
    /// Address to listen on.
    pub bind: Ipv4Addr,
    /// TCP port of every dialect.
    pub port: u16,
    /// TCP port of Modbus/TCP alone.
    pub modbus_port: u16,
    /// Clients served at once; a few places more are kept for stops.
    pub clients: u16,
    /// How long a silent commander keeps its axes, in ms.
    pub lease_ms: u32,
    /// A client that says nothing for so long is let go, in s.
    pub idle_s: u32,
    /// Whether the address is asked for on the network. A board's, as all that follow.
    pub dhcp: bool,
    /// The address where it is not, or where nobody gives one.
    #[serde(serialize_with = "text", deserialize_with = "parsed")]
    pub address: Cidr,
    /// The router of that network, where there is one.
    pub router: Option<Ipv4Addr>,
    /// The board's name on the network.
    pub hostname: String<32>,
}

impl Default for Net {
    fn default() -> Self {
        Self {
            bind: defaults::BIND,
            port: defaults::MAIN_PORT,
            modbus_port: defaults::MODBUS_PORT,
            clients: 16,
            lease_ms: 250,
            idle_s: 120,
            dhcp: true,
            address: Cidr { address: defaults::ADDRESS.0, prefix: defaults::ADDRESS.1 },
            router: defaults::ROUTER,
            hostname: String::try_from("puente").unwrap_or_default(),
        }
    }
}

impl Net {
    /// Whether a client that reaches a gateway with the `other` ones may not reach one with these.
    pub fn leads_elsewhere(&self, other: &Self) -> bool {
        let place = |net: &Self| (net.bind, net.port, net.modbus_port, net.dhcp, net.address, net.router);
        place(self) != place(other)
    }
}

/// What is spoken on a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Protocol {
    /// Modbus RTU.
    ModbusRtu,
    /// Modbus ASCII.
    ModbusAscii,
}

impl Protocol {
    /// As written in the settings.
    pub const fn name(self) -> &'static str {
        match self {
            Protocol::ModbusRtu => "modbus-rtu",
            Protocol::ModbusAscii => "modbus-ascii",
        }
    }
}

/// What a line gives back of what is sent on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Echo {
    /// Nothing: the receiver is off while sending.
    #[default]
    Off,
    /// All of it; it is removed unseen.
    Strip,
    /// All of it; it is compared, and a difference ends the transaction.
    Verify,
}

/// A bus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bus {
    /// Its name, unique.
    pub name: Name,
    /// What is spoken on it.
    pub protocol: Protocol,
    /// `sim`, a serial device, or `tcp:HOST:PORT`.
    pub port: String<64>,
    /// Bits per second.
    #[serde(default = "default_baud")]
    pub baud: u32,
    /// Character format, as in `8E1`.
    #[serde(default = "default_format", serialize_with = "text", deserialize_with = "parsed")]
    pub format: Format,
    /// Modbus unit ids that clients reach here, as in `1-16,20`.
    #[serde(default = "default_units", serialize_with = "text", deserialize_with = "parsed")]
    pub units: Units,
    /// How long a slave has for its reply, in ms, from the end of the request.
    #[serde(default = "default_reply_timeout")]
    pub reply_timeout_ms: u32,
    /// Pause after a broadcast, in ms.
    #[serde(default = "default_turnaround")]
    pub turnaround_ms: u32,
    /// Pause after each transaction before the same slave is addressed again, in ms.
    #[serde(default)]
    pub rest_ms: u32,
    /// How long a slave that did not answer is left alone, in ms, lest its late reply meets the next request.
    /// `reply_timeout_ms` where absent.
    #[serde(default)]
    pub quarantine_ms: Option<u32>,
    /// How long a request may wait for its turn, in ms.
    #[serde(default = "default_queue_timeout")]
    pub queue_timeout_ms: u32,
    /// Whether the line gives back what is sent.
    #[serde(default)]
    pub echo: Echo,
}

/// What drives an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Drive {
    /// An EDB servo drive.
    Edb,
}

impl Drive {
    /// As written in the settings.
    pub const fn name(self) -> &'static str {
        match self {
            Drive::Edb => "edb",
        }
    }
}

/// An axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Axis {
    /// Its name, unique.
    pub name: Name,
    /// The name of its bus.
    pub bus: Name,
    /// What drives it.
    pub drive: Drive,
    /// Address of the drive on its bus, 1 to 247.
    pub address: u8,
    /// Highest jog speed, in r/min.
    #[serde(default = "default_max_rpm")]
    pub max_rpm: u16,
    /// Registers that differ from the EDB family's.
    #[serde(default, serialize_with = "unless_family", deserialize_with = "or_family")]
    pub registers: Registers,
}

/// The family's registers are written as none, for what is compact has no keys that could be left out.
fn unless_family<S: Serializer>(registers: &Registers, serializer: S) -> Result<S::Ok, S::Error> {
    (*registers != Registers::default()).then_some(registers).serialize(serializer)
}

fn or_family<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Registers, D::Error> {
    Option::<Registers>::deserialize(deserializer).map(Option::unwrap_or_default)
}

fn default_baud() -> u32 {
    9600
}

fn default_format() -> Format {
    Format { data_bits: 8, parity: puente_line::Parity::Odd, stop_bits: 1 }
}

fn default_units() -> Units {
    let mut units = Units::default();
    (1..=247).for_each(|unit| units.insert(unit));
    units
}

fn default_reply_timeout() -> u32 {
    500
}

fn default_turnaround() -> u32 {
    100
}

fn default_queue_timeout() -> u32 {
    3000
}

fn default_max_rpm() -> u16 {
    3000
}

fn text<T: fmt::Display, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}

fn parsed<'de, T, D>(deserializer: D) -> Result<T, D::Error>
where
    T: FromStr,
    T::Err: fmt::Display,
    D: Deserializer<'de>,
{
    let text: String<128> = Deserialize::deserialize(deserializer)?;
    text.parse().map_err(de::Error::custom)
}

impl Settings {
    /// What a gateway has that was not told otherwise: one Modbus ASCII bus at 9600 8O1 (the factory setting of EDB
    /// drives) on the port's first line, with axes x, y and z at addresses 1, 2 and 3.
    pub fn factory() -> Self {
        let name = |text: &str| Name::try_from(text).unwrap_or_default();
        let bus = Bus {
            name: name("a"),
            protocol: Protocol::ModbusAscii,
            port: String::try_from(defaults::LINE).unwrap_or_default(),
            baud: default_baud(),
            format: default_format(),
            units: default_units(),
            reply_timeout_ms: default_reply_timeout(),
            turnaround_ms: default_turnaround(),
            rest_ms: 0,
            quarantine_ms: None,
            queue_timeout_ms: default_queue_timeout(),
            echo: Echo::Off,
        };
        let axis = |(text, address)| Axis {
            name: name(text),
            bus: name("a"),
            drive: Drive::Edb,
            address,
            max_rpm: default_max_rpm(),
            registers: Registers::default(),
        };
        Self {
            version: VERSION,
            net: Net::default(),
            buses: [bus].into_iter().collect(),
            axes: [("x", 1), ("y", 2), ("z", 3)].into_iter().map(axis).collect(),
        }
    }

    /// The number of the bus of this name.
    pub fn bus(&self, name: &str) -> Option<u8> {
        self.buses.iter().position(|bus| bus.name == name).map(|index| index as u8)
    }
}

#[cfg(test)]
mod tests;
