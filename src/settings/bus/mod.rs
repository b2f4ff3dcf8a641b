//! A bus: one flat table in a document, an enum of protocols here.
//!
//! The compact form has no keys, and only those values that the protocol has. That of a Modbus bus is as old as the
//! [record](super::record)'s number; firmware that knows no framed or no CANopen bus refuses one.

mod canopen;
mod framed;
mod modbus;
mod table;

use core::fmt;

use heapless::String;
use puente_line::{Format, Settings as Line};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub use canopen::{Canopen, ClientFrames};
pub use framed::{Framed, Policy};
pub use modbus::Modbus;
use table::{KEYS, Table};

use super::{Name, Text};

/// A bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Bus {
    /// Its name, unique.
    pub name: Name,
    /// `sim`, or where the line or the adapter is.
    pub port: String<64>,
    /// What is spoken on it.
    pub protocol: Protocol,
    /// A key that the document has and the protocol has not: [`check`](super::Settings::check) refuses it.
    pub stray: Option<&'static str>,
}

/// What is spoken on a bus, and what goes with that.
#[derive(Clone, Debug, PartialEq)]
pub enum Protocol {
    /// Modbus RTU.
    ModbusRtu(Modbus),
    /// Modbus ASCII.
    ModbusAscii(Modbus),
    /// The framed bus with CSMA/CD.
    Framed(Framed),
    /// CANopen.
    Canopen(Canopen),
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
    /// All of it; it is compared, and a difference ends the transaction or, on a framed bus, is a collision.
    Verify,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    ModbusRtu,
    ModbusAscii,
    Framed,
    Canopen,
}

impl Protocol {
    /// As written in the settings.
    pub const fn name(&self) -> &'static str {
        match self {
            Protocol::ModbusRtu(_) => "modbus-rtu",
            Protocol::ModbusAscii(_) => "modbus-ascii",
            Protocol::Framed(_) => "framed",
            Protocol::Canopen(_) => "canopen",
        }
    }

    const fn kind(&self) -> Kind {
        match self {
            Protocol::ModbusRtu(_) => Kind::ModbusRtu,
            Protocol::ModbusAscii(_) => Kind::ModbusAscii,
            Protocol::Framed(_) => Kind::Framed,
            Protocol::Canopen(_) => Kind::Canopen,
        }
    }
}

impl Bus {
    /// What it has if it is a Modbus bus.
    pub fn modbus(&self) -> Option<&Modbus> {
        match &self.protocol {
            Protocol::ModbusRtu(modbus) | Protocol::ModbusAscii(modbus) => Some(modbus),
            Protocol::Framed(_) | Protocol::Canopen(_) => None,
        }
    }

    /// What it has if it is a framed bus.
    pub fn framed(&self) -> Option<&Framed> {
        match &self.protocol {
            Protocol::Framed(framed) => Some(framed),
            Protocol::ModbusRtu(_) | Protocol::ModbusAscii(_) | Protocol::Canopen(_) => None,
        }
    }

    /// What it has if it is a CANopen bus.
    pub fn canopen(&self) -> Option<&Canopen> {
        match &self.protocol {
            Protocol::Canopen(canopen) => Some(canopen),
            Protocol::ModbusRtu(_) | Protocol::ModbusAscii(_) | Protocol::Framed(_) => None,
        }
    }

    /// Baud rate and character format of a serial line.
    pub fn line(&self) -> Option<Line> {
        match &self.protocol {
            Protocol::ModbusRtu(modbus) | Protocol::ModbusAscii(modbus) => Some(modbus.line),
            Protocol::Framed(framed) => Some(framed.line),
            Protocol::Canopen(_) => None,
        }
    }
}

/// Reads the compact form of a line.
fn compact_line<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Line, D::Error> {
    let (baud, Text(format)): (u32, Text<Format>) = Deserialize::deserialize(deserializer)?;
    Ok(Line { baud, format })
}

impl Serialize for Bus {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_struct("Bus", KEYS.len())?;
        table.serialize_field("name", &self.name)?;
        table.serialize_field("protocol", &self.protocol.kind())?;
        table.serialize_field("port", &self.port)?;
        // In the order of the compact form.
        if let Some(line) = self.line() {
            table.serialize_field("baud", &line.baud)?;
            table.serialize_field("format", &Text(line.format))?;
        }
        match &self.protocol {
            Protocol::ModbusRtu(modbus) | Protocol::ModbusAscii(modbus) => {
                table.serialize_field("units", &Text(modbus.units))?;
                table.serialize_field("reply_timeout_ms", &modbus.reply_timeout_ms)?;
                table.serialize_field("turnaround_ms", &modbus.turnaround_ms)?;
                table.serialize_field("rest_ms", &modbus.rest_ms)?;
                table.serialize_field("quarantine_ms", &modbus.quarantine_ms)?;
                table.serialize_field("queue_timeout_ms", &modbus.queue_timeout_ms)?;
                table.serialize_field("echo", &modbus.echo)?;
            }
            Protocol::Framed(framed) => {
                table.serialize_field("station", &framed.station)?;
                table.serialize_field("policy", &framed.policy)?;
                table.serialize_field("cycle_ms", &framed.cycle_ms)?;
                table.serialize_field("ipg", &framed.ipg)?;
                table.serialize_field("slot", &framed.slot)?;
                table.serialize_field("attempts", &framed.attempts)?;
                table.serialize_field("window", &framed.window)?;
                table.serialize_field("echo", &framed.echo)?;
            }
            Protocol::Canopen(canopen) => {
                table.serialize_field("bitrate", &canopen.bitrate)?;
                table.serialize_field("node", &canopen.node)?;
                table.serialize_field("net", &canopen.net)?;
                table.serialize_field("sync_us", &canopen.sync_us)?;
                table.serialize_field("sync_overflow", &canopen.sync_overflow)?;
                table.serialize_field("heartbeat_ms", &canopen.heartbeat_ms)?;
                table.serialize_field("sdo_timeout_ms", &canopen.sdo_timeout_ms)?;
                table.serialize_field("client_frames", &canopen.client_frames)?;
            }
        }
        table.end()
    }
}

impl<'de> Deserialize<'de> for Bus {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_struct("Bus", KEYS, Reader)
    }
}

struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = Bus;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a bus")
    }

    /// Text: with keys.
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Bus, A::Error> {
        Table::deserialize(MapAccessDeserializer::new(map)).map(Bus::from)
    }

    /// Compact: what there is, in its order.
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Bus, A::Error> {
        let missing = || A::Error::custom("the bus is cut off");
        let name = seq.next_element()?.ok_or_else(missing)?;
        let kind = seq.next_element()?.ok_or_else(missing)?;
        Ok(Bus {
            name,
            port: seq.next_element()?.ok_or_else(missing)?,
            protocol: match kind {
                Kind::ModbusRtu => Protocol::ModbusRtu(seq.next_element()?.ok_or_else(missing)?),
                Kind::ModbusAscii => Protocol::ModbusAscii(seq.next_element()?.ok_or_else(missing)?),
                Kind::Framed => Protocol::Framed(seq.next_element()?.ok_or_else(missing)?),
                Kind::Canopen => Protocol::Canopen(seq.next_element()?.ok_or_else(missing)?),
            },
            stray: None,
        })
    }
}
