//! The settings: one document, TOML in a file, JSON over HTTP, compact in flash. Unknown keys are errors;
//! [`Settings::check`] finds what the types cannot.

mod axis;
mod bus;
mod check;
mod cidr;
mod document;
pub mod json;
pub mod keeper;
mod node;
pub mod record;
pub mod store;
mod write;

use core::fmt;
use core::net::Ipv4Addr;
use core::str::FromStr;

use heapless::{String, Vec};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

pub use axis::{Axis, Cia402, Drive, Edb, Payload, Pid};
pub use bus::{Bus, Canopen, ClientFrames, Echo, Framed, Modbus, Policy, Protocol};
pub use check::Problem;
pub use cidr::{BadCidr, Cidr};
pub use node::{AXIS_HEARTBEAT_MS, Node};
pub use write::{Value, Write};

use crate::port::defaults;
use crate::port::limits::{AXES, BUSES, NODES};

/// The version of the document's keys that this firmware reads and writes.
pub const VERSION: u32 = 1;

/// A name of a bus or an axis.
pub type Name = String<16>;

/// The whole document.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Version of the keys, [`VERSION`].
    pub version: u32,
    /// TCP side.
    pub net: Net,
    /// The buses.
    pub buses: Vec<Bus, BUSES>,
    /// The axes.
    pub axes: Vec<Axis, AXES>,
    /// The nodes of CANopen buses of which there is something to say.
    pub nodes: Vec<Node, NODES>,
}

impl Serialize for Settings {
    /// The compact form has no nodes here, see `document::Later`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let readable = serializer.is_human_readable();
        let mut document = serializer.serialize_struct("Settings", document::FIELDS.len())?;
        document.serialize_field("version", &self.version)?;
        document.serialize_field("net", &self.net)?;
        document.serialize_field("bus", &self.buses)?;
        document.serialize_field("axis", &self.axes)?;
        if readable {
            document.serialize_field("node", &self.nodes)?;
        }
        document.end()
    }
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
    /// TCP port of SLCAN; 0: there is none.
    #[serde(with = "later")]
    pub slcan_port: u16,
    /// TCP port of socketcand; 0: there is none.
    #[serde(with = "later")]
    pub socketcand_port: u16,
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
            slcan_port: 0,
            socketcand_port: 0,
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

/// A port that the compact form does not have here: [`document::Later`] has it. A unit takes no room there.
mod later {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(super) fn serialize<S: Serializer>(port: &u16, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() { port.serialize(serializer) } else { ().serialize(serializer) }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u16, D::Error> {
        if deserializer.is_human_readable() {
            u16::deserialize(deserializer)
        } else {
            <()>::deserialize(deserializer).map(|()| 0)
        }
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
            nodes: Vec::new(),
        }
    }

    /// The number of the bus of this name.
    pub fn bus(&self, name: &str) -> Option<u8> {
        self.buses.iter().position(|bus| bus.name == name).map(|index| index as u8)
    }
}

#[cfg(test)]
mod tests;
