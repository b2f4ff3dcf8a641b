//! The settings: one document, TOML in a file, JSON over HTTP, compact in flash. Unknown keys are errors;
//! [`Settings::check`] finds what the types cannot.

mod axis;
mod bus;
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
use puente_line::{Format, Parity};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

pub use axis::{Axis, Drive, Edb, Payload, Pid};
pub use bus::{Bus, Echo, Framed, Modbus, Policy, Protocol};
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

/// A value that a document has as text.
struct Text<T>(T);

impl<T: fmt::Display> Serialize for Text<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        text(&self.0, serializer)
    }
}

impl<'de, T: FromStr<Err: fmt::Display>> Deserialize<'de> for Text<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parsed(deserializer).map(Text)
    }
}

impl Settings {
    /// What a gateway has that was not told otherwise: one Modbus ASCII bus at 9600 8O1 (the factory setting of EDB
    /// drives) on the port's first line, with axes x, y and z at addresses 1, 2 and 3.
    pub fn factory() -> Self {
        let name = |text: &str| Name::try_from(text).unwrap_or_default();
        let bus = Bus {
            name: name("a"),
            port: String::try_from(defaults::LINE).unwrap_or_default(),
            baud: 9600,
            format: Format { data_bits: 8, parity: Parity::Odd, stop_bits: 1 },
            protocol: Protocol::ModbusAscii(Modbus::default()),
            stray: None,
        };
        let axis = |(text, address)| Axis {
            name: name(text),
            bus: name("a"),
            address,
            drive: Drive::Edb(Edb::default()),
            stray: None,
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
