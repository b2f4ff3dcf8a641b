//! What is said of nodes and their objects. The names of the fields are the interface, see docs/http.md.

use core::fmt;

use heapless::{String, Vec};
use puente_canopen::boot::Verdict;
use puente_canopen::emcy::{self, Register};
use puente_canopen::manager::{Health, Status};
use puente_canopen::{Address, NodeId, nmt};
use puente_eds::{Access, NAME, Number, VALUE};
use puente_line::{Instant, millis};
use serde::{Serialize, Serializer};

use super::super::view::Text;
use crate::front::dictionary::{Found, Held, Named};
use crate::front::objects::{Hex, Shown, command_name, word};
use crate::settings;

/// A node.
#[derive(Serialize)]
pub(super) struct Node<'a> {
    node: u8,
    name: Option<&'a str>,
    axis: Option<&'a str>,
    optional: bool,
    state: Option<Text<nmt::State>>,
    health: &'static str,
    verdict: Option<Text<Verdict>>,
    heard_ms: Option<u64>,
    emergency: Option<Emergency>,
    duplicate: bool,
    objects: u32,
}

/// What there is to say of a node at one moment.
pub(super) struct Findings<'a> {
    pub now: Instant,
    pub node: NodeId,
    pub status: Status,
    pub settings: Option<&'a settings::Node>,
    pub axis: Option<&'a str>,
    pub held: Option<Held>,
}

impl<'a> Node<'a> {
    pub fn new(found: &Findings<'a>) -> Self {
        let Status { state, health, heard, emergency, duplicate } = found.status;
        Self {
            node: found.node.value(),
            name: found.settings.and_then(|node| node.name.as_deref()),
            axis: found.axis,
            optional: found.settings.is_some_and(|node| node.optional),
            state: state.map(Text),
            health: word(health),
            verdict: if let Health::Refused(verdict) = health { Some(Text(verdict)) } else { None },
            heard_ms: heard.map(|heard| millis(found.now.since(heard))),
            emergency: emergency.map(Emergency::new),
            duplicate,
            objects: found.held.map_or(0, |held| held.objects),
        }
    }
}

/// An emergency message.
#[derive(Serialize)]
struct Emergency {
    code: Text<Hex<2>>,
    text: &'static str,
    register: Text<Hex<1>>,
    flags: Vec<&'static str, 7>,
    vendor: Text<Hex<5>>,
}

/// The same, and when it came.
#[derive(Serialize)]
pub(super) struct Dated {
    age_ms: u64,
    emergency: Emergency,
}

impl Dated {
    pub fn new(now: Instant, at: Instant, emergency: emcy::Emergency) -> Self {
        Self { age_ms: millis(now.since(at)), emergency: Emergency::new(emergency) }
    }
}

impl Emergency {
    fn new(emergency: emcy::Emergency) -> Self {
        Self {
            code: Text(Hex(emergency.code.to_be_bytes())),
            text: emcy::describe(emergency.code),
            register: Text(Hex([emergency.register])),
            flags: Register(emergency.register).names().collect(),
            vendor: Text(Hex(emergency.vendor)),
        }
    }
}

/// An NMT command that is on its way.
#[derive(Serialize)]
pub(super) struct Commanded {
    /// 0: all.
    node: u8,
    command: &'static str,
}

impl Commanded {
    pub fn new(node: Option<NodeId>, command: nmt::Command) -> Self {
        Self { node: node.map_or(0, NodeId::value), command: command_name(command) }
    }
}

/// What is kept of a data sheet.
#[derive(Serialize)]
pub(super) struct Sheet {
    objects: u32,
    left_out: u32,
}

impl Sheet {
    pub fn new(held: Option<Held>) -> Self {
        let (objects, left_out) = held.map_or((0, 0), |held| (held.objects, held.left_out));
        Self { objects, left_out }
    }
}

/// What a data sheet tells of an object, copied out.
pub(super) struct Known {
    index: u16,
    first: u8,
    last: u8,
    object: Option<String<NAME>>,
    name: Option<String<NAME>>,
    kind: puente_eds::DataType,
    said: Named,
    access: Option<Access>,
    low: String<VALUE>,
    high: String<VALUE>,
    default: String<VALUE>,
}

impl Known {
    pub fn new(found: &Found<'_>) -> Self {
        // What was kept has room.
        let text = |text| String::try_from(text).unwrap_or_default();
        let Found { object, group, name } = found;
        Self {
            index: object.index,
            first: object.first,
            last: object.last,
            object: group.map(|text| String::try_from(text).unwrap_or_default()),
            name: name.map(|text| String::try_from(text).unwrap_or_default()),
            kind: object.kind,
            said: found.kind(),
            access: object.access,
            low: text(object.low),
            high: text(object.high),
            default: text(object.default),
        }
    }
}

/// An object, with its value or without.
#[derive(Serialize)]
pub(super) struct Object<'a> {
    index: Text<Index>,
    sub: u8,
    #[serde(skip_serializing_if = "Option::is_none")]
    last_sub: Option<u8>,
    object: Option<&'a str>,
    name: Option<&'a str>,
    #[serde(rename = "type")]
    said: &'static str,
    access: Option<&'static str>,
    low: Option<Limit<'a>>,
    high: Option<Limit<'a>>,
    default: Option<Limit<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<Shown<'a>>,
}

impl<'a> Object<'a> {
    /// One of a list.
    pub fn listed(node: NodeId, known: &'a Known) -> Self {
        let last_sub = (known.last > known.first).then_some(known.last);
        let address = Address::new(known.index, known.first);
        Self { last_sub, ..Self::new(node, address, Some(known), known.said, None) }
    }

    /// One that was read, with its bytes, or written.
    pub fn new(
        node: NodeId,
        address: Address,
        known: Option<&'a Known>,
        (said, kind): Named,
        bytes: Option<&'a [u8]>,
    ) -> Self {
        let limit = |text: fn(&Known) -> &str| {
            known
                .map(|known| Limit { text: text(known), kind: known.kind, node })
                .filter(|limit| !limit.text.is_empty())
        };
        Self {
            index: Text(Index(address.index)),
            sub: address.sub,
            last_sub: None,
            object: known.and_then(|known| known.object.as_deref()),
            name: known.and_then(|known| known.name.as_deref()),
            said,
            access: known.and_then(|known| known.access).map(Access::name),
            low: limit(|known| &known.low),
            high: limit(|known| &known.high),
            default: limit(|known| &known.default),
            value: bytes.map(|bytes| Shown { bytes, kind }),
        }
    }
}

/// An index, as in `0x6041`.
struct Index(u16);

impl fmt::Display for Index {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:04X}", self.0)
    }
}

/// A limit or default: a number where it is one, or else the text of the data sheet.
struct Limit<'a> {
    text: &'a str,
    kind: puente_eds::DataType,
    node: NodeId,
}

impl Serialize for Limit<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match Number::parse(self.text, self.kind, self.node.value()) {
            Some(Number { negative: true, magnitude }) => {
                serializer.serialize_i64(0_i64.wrapping_sub_unsigned(magnitude))
            }
            Some(Number { negative: false, magnitude }) => serializer.serialize_u64(magnitude),
            None => serializer.serialize_str(self.text),
        }
    }
}
