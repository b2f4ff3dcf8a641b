//! An axis: one flat table in a document, an enum of drives here, as with a [bus](super::bus).

use core::fmt;
use core::str::FromStr;

use puente_drives::cia402;
use puente_drives::edb::Registers;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, SeqAccess, Visitor};
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Name, Text};

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its name, unique.
    pub name: Name,
    /// The name of its bus.
    pub bus: Name,
    /// Address of the drive on its bus: 1 to 247, on a framed bus 1 to 254; on a CANopen bus its node-ID, 1 to 127.
    pub address: u8,
    /// What drives it.
    pub drive: Drive,
    /// A key that the document has and the drive has not: [`check`](super::Settings::check) refuses it.
    pub stray: Option<&'static str>,
}

/// What drives an axis, and what goes with that.
#[derive(Clone, Debug, PartialEq)]
pub enum Drive {
    /// An EDB servo drive.
    Edb(Edb),
    /// A PID interface module.
    Pid(Pid),
    /// A drive of CiA 402.
    Cia402(Cia402),
}

/// What an EDB drive has.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Edb {
    /// Highest jog speed, in r/min.
    pub max_rpm: u16,
    /// Registers that differ from the EDB family's.
    #[serde(deserialize_with = "or_family")]
    pub registers: Registers,
}

/// What a PID module has.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
pub struct Pid {
    /// How the gateway writes to it.
    pub payload: Payload,
    /// Kp, Ki and Kd, as the drive's [`Gains`](puente_drives::pid::Gains) has them; none until somebody gives some.
    pub gains: Option<[f32; 3]>,
}

/// What a drive of CiA 402 has.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Cia402 {
    /// What kind it is.
    #[serde(deserialize_with = "profile")]
    pub profile: &'static cia402::Profile,
    /// How it is homed (6098h) where nobody says otherwise; as the drive has it where absent, as with all that follow.
    pub homing: Option<i8>,
    /// Speed of homing to the switch (6099h:1), in the drive's unit.
    pub homing_fast: Option<u32>,
    /// Speed of homing to the zero (6099h:2), in the drive's unit.
    pub homing_slow: Option<u32>,
    /// Acceleration of homing (609Ah), in the drive's unit.
    pub homing_acceleration: Option<u32>,
    /// Highest profile velocity (607Fh), in the drive's unit.
    pub max_velocity: Option<u32>,
    /// The mode whose set-points come with SYNC, interpolated or cyclic synchronous position: it moves to positions in that.
    /// The compact form has it elsewhere, see `document::Cyclic`.
    #[serde(skip)]
    pub cyclic: Option<cia402::Mode>,
}

/// A profile by its name.
struct ProfileName(&'static cia402::Profile);

impl fmt::Display for ProfileName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.name)
    }
}

impl FromStr for ProfileName {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const KNOWN: &str = "\"lexium23a\", \"festo-cmms\" or \"generic\" is a profile";
        cia402::Profile::named(text).map(Self).ok_or(KNOWN)
    }
}

fn profile<'de, D: Deserializer<'de>>(deserializer: D) -> Result<&'static cia402::Profile, D::Error> {
    Text::<ProfileName>::deserialize(deserializer).map(|text| text.0.0)
}

/// A mode whose set-points come with SYNC, by its name.
struct CyclicName(cia402::Mode);

/// Those that moves can be made in.
pub(super) const CYCLIC: [cia402::Mode; 2] =
    [cia402::Mode::InterpolatedPosition, cia402::Mode::CyclicPosition];

impl fmt::Display for CyclicName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.0, f)
    }
}

impl FromStr for CyclicName {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "ip" => Ok(Self(cia402::Mode::InterpolatedPosition)),
            "csp" => Ok(Self(cia402::Mode::CyclicPosition)),
            _ => Err("\"ip\" or \"csp\" is a cyclic mode"),
        }
    }
}

impl Default for Cia402 {
    fn default() -> Self {
        Self {
            profile: &cia402::Profile::GENERIC,
            homing: None,
            homing_fast: None,
            homing_slow: None,
            homing_acceleration: None,
            max_velocity: None,
            cyclic: None,
        }
    }
}

/// How numbers are written to a PID module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Payload {
    /// As decimal text, in the form of the thesis.
    #[default]
    Text,
    /// As `f32`.
    Binary,
}

impl Default for Edb {
    fn default() -> Self {
        Self { max_rpm: 3000, registers: Registers::default() }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Edb,
    Pid,
    Cia402,
}

impl Drive {
    /// As written in the settings.
    pub const fn name(&self) -> &'static str {
        match self {
            Drive::Edb(_) => "edb",
            Drive::Pid(_) => "pid",
            Drive::Cia402(_) => "cia402",
        }
    }

    const fn kind(&self) -> Kind {
        match self {
            Drive::Edb(_) => Kind::Edb,
            Drive::Pid(_) => Kind::Pid,
            Drive::Cia402(_) => Kind::Cia402,
        }
    }
}

/// The family's registers are written as none, for what is compact has no keys that could be left out.
fn unless_family(registers: &Registers) -> Option<&Registers> {
    (*registers != Registers::default()).then_some(registers)
}

fn or_family<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Registers, D::Error> {
    Option::<Registers>::deserialize(deserializer).map(Option::unwrap_or_default)
}

/// An axis as a document has it, with the keys of every drive.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    name: Name,
    bus: Name,
    drive: Kind,
    address: u8,
    max_rpm: Option<u16>,
    registers: Option<Registers>,
    payload: Option<Payload>,
    gains: Option<[f32; 3]>,
    profile: Option<Text<ProfileName>>,
    homing: Option<i8>,
    homing_fast: Option<u32>,
    homing_slow: Option<u32>,
    homing_acceleration: Option<u32>,
    max_velocity: Option<u32>,
    cyclic: Option<Text<CyclicName>>,
}

const KEYS: &[&str] = &[
    "name",
    "bus",
    "drive",
    "address",
    "max_rpm",
    "registers",
    "payload",
    "gains",
    "profile",
    "homing",
    "homing_fast",
    "homing_slow",
    "homing_acceleration",
    "max_velocity",
    "cyclic",
];

impl Table {
    fn edb(&self) -> Edb {
        let usual = Edb::default();
        Edb {
            max_rpm: self.max_rpm.unwrap_or(usual.max_rpm),
            registers: self.registers.unwrap_or(usual.registers),
        }
    }

    fn pid(&self) -> Pid {
        Pid { payload: self.payload.unwrap_or_default(), gains: self.gains }
    }

    fn cia402(&self) -> Cia402 {
        Cia402 {
            profile: self.profile.as_ref().map_or(Cia402::default().profile, |text| text.0.0),
            homing: self.homing,
            homing_fast: self.homing_fast,
            homing_slow: self.homing_slow,
            homing_acceleration: self.homing_acceleration,
            max_velocity: self.max_velocity,
            cyclic: self.cyclic.as_ref().map(|text| text.0.0),
        }
    }

    /// The first key that is given and that another drive has.
    fn stray(&self) -> Option<&'static str> {
        let others = [
            (Kind::Edb, "max_rpm", self.max_rpm.is_some()),
            (Kind::Edb, "registers", self.registers.is_some()),
            (Kind::Pid, "payload", self.payload.is_some()),
            (Kind::Pid, "gains", self.gains.is_some()),
            (Kind::Cia402, "profile", self.profile.is_some()),
            (Kind::Cia402, "homing", self.homing.is_some()),
            (Kind::Cia402, "homing_fast", self.homing_fast.is_some()),
            (Kind::Cia402, "homing_slow", self.homing_slow.is_some()),
            (Kind::Cia402, "homing_acceleration", self.homing_acceleration.is_some()),
            (Kind::Cia402, "max_velocity", self.max_velocity.is_some()),
            (Kind::Cia402, "cyclic", self.cyclic.is_some()),
        ];
        let stray = others.iter().find(|(kind, _, given)| *given && *kind != self.drive);
        stray.map(|(_, key, _)| *key)
    }
}

impl From<Table> for Axis {
    fn from(table: Table) -> Self {
        Self {
            drive: match table.drive {
                Kind::Edb => Drive::Edb(table.edb()),
                Kind::Pid => Drive::Pid(table.pid()),
                Kind::Cia402 => Drive::Cia402(table.cia402()),
            },
            stray: table.stray(),
            name: table.name,
            bus: table.bus,
            address: table.address,
        }
    }
}

impl Serialize for Axis {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let readable = serializer.is_human_readable();
        let mut table = serializer.serialize_struct("Axis", KEYS.len())?;
        table.serialize_field("name", &self.name)?;
        table.serialize_field("bus", &self.bus)?;
        table.serialize_field("drive", &self.drive.kind())?;
        table.serialize_field("address", &self.address)?;
        // In the order of the compact form.
        match &self.drive {
            Drive::Edb(edb) => {
                table.serialize_field("max_rpm", &edb.max_rpm)?;
                table.serialize_field("registers", &unless_family(&edb.registers))?;
            }
            Drive::Pid(pid) => {
                table.serialize_field("payload", &pid.payload)?;
                table.serialize_field("gains", &pid.gains)?;
            }
            Drive::Cia402(cia402) => {
                table.serialize_field("profile", cia402.profile.name)?;
                table.serialize_field("homing", &cia402.homing)?;
                table.serialize_field("homing_fast", &cia402.homing_fast)?;
                table.serialize_field("homing_slow", &cia402.homing_slow)?;
                table.serialize_field("homing_acceleration", &cia402.homing_acceleration)?;
                table.serialize_field("max_velocity", &cia402.max_velocity)?;
                if readable {
                    table.serialize_field("cyclic", &cia402.cyclic.map(|mode| Text(CyclicName(mode))))?;
                }
            }
        }
        table.end()
    }
}

impl<'de> Deserialize<'de> for Axis {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_struct("Axis", KEYS, Reader)
    }
}

struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = Axis;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an axis")
    }

    /// Text: with keys.
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Axis, A::Error> {
        Table::deserialize(MapAccessDeserializer::new(map)).map(Axis::from)
    }

    /// Compact: what there is, in its order.
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Axis, A::Error> {
        let missing = || A::Error::custom("the axis is cut off");
        let name = seq.next_element()?.ok_or_else(missing)?;
        let bus = seq.next_element()?.ok_or_else(missing)?;
        let kind = seq.next_element()?.ok_or_else(missing)?;
        Ok(Axis {
            name,
            bus,
            address: seq.next_element()?.ok_or_else(missing)?,
            drive: match kind {
                Kind::Edb => Drive::Edb(seq.next_element()?.ok_or_else(missing)?),
                Kind::Pid => Drive::Pid(seq.next_element()?.ok_or_else(missing)?),
                Kind::Cia402 => Drive::Cia402(seq.next_element()?.ok_or_else(missing)?),
            },
            stray: None,
        })
    }
}
