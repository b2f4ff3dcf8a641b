//! A bus: one flat table in a document, an enum of protocols here.
//!
//! The compact form has no keys, and only those values that the protocol has. That of a Modbus bus is as old as the
//! [record](super::record)'s number; firmware that knows no framed bus refuses one.

use core::fmt;

use heapless::String;
use puente_line::{Format, Parity};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Name, Text};
use crate::desk::Units;

/// A bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Bus {
    /// Its name, unique.
    pub name: Name,
    /// `sim`, a serial device, or `tcp:HOST:PORT`.
    pub port: String<64>,
    /// Bits per second.
    pub baud: u32,
    /// Character format, as in `8E1`.
    pub format: Format,
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
}

/// What a Modbus bus has.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Modbus {
    /// Modbus unit ids that clients reach here, as in `1-16,20`.
    #[serde(deserialize_with = "super::parsed")]
    pub units: Units,
    /// How long a slave has for its reply, in ms, from the end of the request.
    pub reply_timeout_ms: u32,
    /// Pause after a broadcast, in ms.
    pub turnaround_ms: u32,
    /// Pause after each transaction before the same slave is addressed again, in ms.
    pub rest_ms: u32,
    /// How long a slave that did not answer is left alone, in ms, lest its late reply meets the next request.
    /// `reply_timeout_ms` where absent.
    pub quarantine_ms: Option<u32>,
    /// How long a request may wait for its turn, in ms.
    pub queue_timeout_ms: u32,
    /// Whether the line gives back what is sent.
    pub echo: Echo,
}

/// What a framed bus has.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Framed {
    /// The gateway's own address on the line.
    pub station: u8,
    /// How the back-off grows.
    pub policy: Policy,
    /// Time from one cyclic packet to the next, in ms.
    pub cycle_ms: u16,
    /// Silence before a frame, the inter-packet gap, in characters.
    pub ipg: u16,
    /// Unit of the back-off, in characters.
    pub slot: u16,
    /// Collisions in a row after which a frame is given up.
    pub attempts: u8,
    /// Frames outstanding to one station.
    pub window: u8,
    /// Whether the line gives back what is sent: only then collisions are seen.
    pub echo: Echo,
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

/// How the back-off of a framed bus grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Policy {
    /// Truncated binary exponential.
    Truncated,
    /// As in the thesis.
    Thesis,
}

impl Default for Modbus {
    fn default() -> Self {
        let mut units = Units::default();
        (1..=247).for_each(|unit| units.insert(unit));
        Self {
            units,
            reply_timeout_ms: 500,
            turnaround_ms: 100,
            rest_ms: 0,
            quarantine_ms: None,
            queue_timeout_ms: 3000,
            echo: Echo::Off,
        }
    }
}

impl Default for Framed {
    fn default() -> Self {
        Self {
            station: 1,
            policy: Policy::Truncated,
            cycle_ms: 2,
            ipg: 2,
            slot: 8,
            attempts: 16,
            window: 4,
            echo: Echo::Verify,
        }
    }
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    ModbusRtu,
    ModbusAscii,
    Framed,
}

impl Kind {
    /// The line's usual baud rate and format: the factory setting of EDB drives, or the rate of the thesis' tests.
    const fn line(self) -> (u32, Format) {
        match self {
            Kind::ModbusRtu | Kind::ModbusAscii => {
                (9600, Format { data_bits: 8, parity: Parity::Odd, stop_bits: 1 })
            }
            Kind::Framed => (1_000_000, Format { data_bits: 8, parity: Parity::None, stop_bits: 1 }),
        }
    }
}

impl Protocol {
    /// As written in the settings.
    pub const fn name(&self) -> &'static str {
        match self {
            Protocol::ModbusRtu(_) => "modbus-rtu",
            Protocol::ModbusAscii(_) => "modbus-ascii",
            Protocol::Framed(_) => "framed",
        }
    }

    const fn kind(&self) -> Kind {
        match self {
            Protocol::ModbusRtu(_) => Kind::ModbusRtu,
            Protocol::ModbusAscii(_) => Kind::ModbusAscii,
            Protocol::Framed(_) => Kind::Framed,
        }
    }
}

impl Bus {
    /// What it has if it is a Modbus bus.
    pub fn modbus(&self) -> Option<&Modbus> {
        match &self.protocol {
            Protocol::ModbusRtu(modbus) | Protocol::ModbusAscii(modbus) => Some(modbus),
            Protocol::Framed(_) => None,
        }
    }

    /// What it has if it is a framed bus.
    pub fn framed(&self) -> Option<&Framed> {
        match &self.protocol {
            Protocol::Framed(framed) => Some(framed),
            Protocol::ModbusRtu(_) | Protocol::ModbusAscii(_) => None,
        }
    }
}

/// A bus as a document has it, with the keys of every protocol.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    name: Name,
    protocol: Kind,
    port: String<64>,
    baud: Option<u32>,
    format: Option<Text<Format>>,
    units: Option<Text<Units>>,
    reply_timeout_ms: Option<u32>,
    turnaround_ms: Option<u32>,
    rest_ms: Option<u32>,
    quarantine_ms: Option<u32>,
    queue_timeout_ms: Option<u32>,
    echo: Option<Echo>,
    station: Option<u8>,
    policy: Option<Policy>,
    cycle_ms: Option<u16>,
    ipg: Option<u16>,
    slot: Option<u16>,
    attempts: Option<u8>,
    window: Option<u8>,
}

const KEYS: &[&str] = &[
    "name",
    "protocol",
    "port",
    "baud",
    "format",
    "units",
    "reply_timeout_ms",
    "turnaround_ms",
    "rest_ms",
    "quarantine_ms",
    "queue_timeout_ms",
    "echo",
    "station",
    "policy",
    "cycle_ms",
    "ipg",
    "slot",
    "attempts",
    "window",
];

impl Table {
    fn modbus(&self) -> Modbus {
        let usual = Modbus::default();
        Modbus {
            units: self.units.as_ref().map_or(usual.units, |text| text.0),
            reply_timeout_ms: self.reply_timeout_ms.unwrap_or(usual.reply_timeout_ms),
            turnaround_ms: self.turnaround_ms.unwrap_or(usual.turnaround_ms),
            rest_ms: self.rest_ms.unwrap_or(usual.rest_ms),
            quarantine_ms: self.quarantine_ms,
            queue_timeout_ms: self.queue_timeout_ms.unwrap_or(usual.queue_timeout_ms),
            echo: self.echo.unwrap_or(usual.echo),
        }
    }

    fn framed(&self) -> Framed {
        let usual = Framed::default();
        Framed {
            station: self.station.unwrap_or(usual.station),
            policy: self.policy.unwrap_or(usual.policy),
            cycle_ms: self.cycle_ms.unwrap_or(usual.cycle_ms),
            ipg: self.ipg.unwrap_or(usual.ipg),
            slot: self.slot.unwrap_or(usual.slot),
            attempts: self.attempts.unwrap_or(usual.attempts),
            window: self.window.unwrap_or(usual.window),
            echo: self.echo.unwrap_or(usual.echo),
        }
    }

    /// The first key that is given and that another protocol has.
    fn stray(&self) -> Option<&'static str> {
        let modbus = [
            ("units", self.units.is_some()),
            ("reply_timeout_ms", self.reply_timeout_ms.is_some()),
            ("turnaround_ms", self.turnaround_ms.is_some()),
            ("rest_ms", self.rest_ms.is_some()),
            ("quarantine_ms", self.quarantine_ms.is_some()),
            ("queue_timeout_ms", self.queue_timeout_ms.is_some()),
        ];
        let framed = [
            ("station", self.station.is_some()),
            ("policy", self.policy.is_some()),
            ("cycle_ms", self.cycle_ms.is_some()),
            ("ipg", self.ipg.is_some()),
            ("slot", self.slot.is_some()),
            ("attempts", self.attempts.is_some()),
            ("window", self.window.is_some()),
        ];
        let others: &[_] = match self.protocol {
            Kind::ModbusRtu | Kind::ModbusAscii => &framed,
            Kind::Framed => &modbus,
        };
        others.iter().find(|(_, given)| *given).map(|(key, _)| *key)
    }
}

impl From<Table> for Bus {
    fn from(table: Table) -> Self {
        let (baud, format) = table.protocol.line();
        Self {
            protocol: match table.protocol {
                Kind::ModbusRtu => Protocol::ModbusRtu(table.modbus()),
                Kind::ModbusAscii => Protocol::ModbusAscii(table.modbus()),
                Kind::Framed => Protocol::Framed(table.framed()),
            },
            stray: table.stray(),
            baud: table.baud.unwrap_or(baud),
            format: table.format.map_or(format, |text| text.0),
            name: table.name,
            port: table.port,
        }
    }
}

impl Serialize for Bus {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_struct("Bus", KEYS.len())?;
        table.serialize_field("name", &self.name)?;
        table.serialize_field("protocol", &self.protocol.kind())?;
        table.serialize_field("port", &self.port)?;
        table.serialize_field("baud", &self.baud)?;
        table.serialize_field("format", &Text(self.format))?;
        // In the order of the compact form.
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
            baud: seq.next_element()?.ok_or_else(missing)?,
            format: seq.next_element::<Text<Format>>()?.ok_or_else(missing)?.0,
            protocol: match kind {
                Kind::ModbusRtu => Protocol::ModbusRtu(seq.next_element()?.ok_or_else(missing)?),
                Kind::ModbusAscii => Protocol::ModbusAscii(seq.next_element()?.ok_or_else(missing)?),
                Kind::Framed => Protocol::Framed(seq.next_element()?.ok_or_else(missing)?),
            },
            stray: None,
        })
    }
}
