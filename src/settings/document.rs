//! Reads a document into its place, bus by bus and axis by axis: on the stack of a microcontroller there is no room for
//! several of them, which serde's own way takes.

use core::fmt;

use heapless::Vec;
use puente_drives::cia402::Mode;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize, de};

use super::axis::CYCLIC;
use super::{Axis, Drive, Net, Settings, VERSION};
use crate::port::limits::AXES;

#[derive(Clone, Copy, Deserialize)]
#[serde(field_identifier, rename_all = "lowercase")]
enum Field {
    Version,
    Net,
    Bus,
    Axis,
    Node,
}

pub(super) const FIELDS: &[&str] = &["version", "net", "bus", "axis", "node"];

impl Settings {
    /// What the keys stand for that a document does not have. It does not hold: there is no bus.
    pub(super) fn blank() -> Self {
        Self { version: VERSION, net: Net::default(), buses: Vec::new(), axes: Vec::new(), nodes: Vec::new() }
    }
}

impl<'de> Deserialize<'de> for Settings {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut settings = Self::blank();
        Place(&mut settings).deserialize(deserializer)?;
        Ok(settings)
    }
}

/// Where a document is read to. Where that fails, half of it may be there.
pub(super) struct Place<'s>(pub &'s mut Settings);

impl<'de> DeserializeSeed<'de> for Place<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_struct("Settings", FIELDS, self)
    }
}

impl<'de> Visitor<'de> for Place<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a settings document")
    }

    /// Text: with keys.
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let settings = self.0;
        let mut seen = [false; FIELDS.len()];
        while let Some(field) = map.next_key::<Field>()? {
            let index = field as usize;
            if seen.get_mut(index).is_some_and(|seen| core::mem::replace(seen, true)) {
                return Err(A::Error::duplicate_field(FIELDS.get(index).copied().unwrap_or_default()));
            }
            match field {
                Field::Version => settings.version = map.next_value()?,
                Field::Net => settings.net = map.next_value()?,
                Field::Bus => map.next_value_seed(List(&mut settings.buses))?,
                Field::Axis => map.next_value_seed(List(&mut settings.axes))?,
                Field::Node => map.next_value_seed(List(&mut settings.nodes))?,
            }
        }
        if seen.get(Field::Bus as usize) == Some(&true) {
            Ok(())
        } else {
            Err(A::Error::missing_field("bus"))
        }
    }

    /// Compact: all there is but what [`Later`] has, in its order.
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        let missing = || A::Error::custom("the document is cut off");
        let settings = self.0;
        settings.version = seq.next_element()?.ok_or_else(missing)?;
        settings.net = seq.next_element()?.ok_or_else(missing)?;
        seq.next_element_seed(List(&mut settings.buses))?.ok_or_else(missing)?;
        seq.next_element_seed(List(&mut settings.axes))?.ok_or_else(missing)
    }
}

/// What documents have since there are CANopen buses. The compact form has it after the rest, and only where it says
/// something: one without is as it was before, and firmware that does not know it refuses one with it.
pub(super) struct Later<'s>(pub &'s mut Settings);

impl<'de> DeserializeSeed<'de> for Later<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_tuple(3, self)
    }
}

impl<'de> Visitor<'de> for Later<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("ports and nodes")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        let missing = || A::Error::custom("the document is cut off");
        let Settings { net, nodes, .. } = self.0;
        net.slcan_port = seq.next_element()?.ok_or_else(missing)?;
        net.socketcand_port = seq.next_element()?.ok_or_else(missing)?;
        seq.next_element_seed(List(nodes))?.ok_or_else(missing)
    }
}

/// As it is read; none where it says nothing, unless something `follows`.
pub(super) fn later(settings: &Settings, follows: bool) -> Option<impl Serialize> {
    let Settings { net, nodes, .. } = settings;
    let later = (net.slcan_port, net.socketcand_port, nodes.as_slice());
    (later.0 != 0 || later.1 != 0 || !later.2.is_empty() || follows).then_some(later)
}

/// The cyclic modes of the axes, each as its code, in their order; 0: none. It follows after [`Later`], by the same rule.
pub(super) struct Cyclic<'s>(pub &'s mut Settings);

impl<'de> DeserializeSeed<'de> for Cyclic<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        let codes = Vec::<i8, AXES>::deserialize(deserializer)?;
        for (place, code) in codes.into_iter().enumerate().filter(|(_, code)| *code != 0) {
            let axis = self.0.axes.get_mut(place).map(|axis| &mut axis.drive);
            let mode = Mode::from_code(code).filter(|mode| CYCLIC.contains(mode));
            let (Some(Drive::Cia402(cia402)), Some(mode)) = (axis, mode) else {
                return Err(D::Error::custom("an axis has no such mode"));
            };
            cia402.cyclic = Some(mode);
        }
        Ok(())
    }
}

/// As it is read; none where it says nothing.
pub(super) fn cyclic(settings: &Settings) -> Option<impl Serialize> {
    let code = |axis: &Axis| match &axis.drive {
        Drive::Cia402(cia402) => cia402.cyclic.map_or(0, Mode::code),
        Drive::Edb(_) | Drive::Pid(_) => 0,
    };
    let codes: Vec<i8, AXES> = settings.axes.iter().map(code).collect();
    codes.iter().any(|code| *code != 0).then_some(codes)
}

/// Where buses, axes or nodes are read to.
struct List<'s, T, const N: usize>(&'s mut Vec<T, N>);

impl<'de, T: Deserialize<'de>, const N: usize> DeserializeSeed<'de> for List<'_, T, N> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for List<'_, T, N> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "at most {N} of them")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        while let Some(item) = seq.next_element()? {
            if self.0.push(item).is_err() {
                return Err(de::Error::invalid_length(N + 1, &self));
            }
        }
        Ok(())
    }
}
