//! Reads a document into its place, bus by bus and axis by axis: on the stack of a microcontroller there is no room for
//! several of them, which serde's own way takes.

use core::fmt;

use heapless::Vec;
use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, de};

use super::{Net, Settings, VERSION};

#[derive(Clone, Copy, Deserialize)]
#[serde(field_identifier, rename_all = "lowercase")]
enum Field {
    Version,
    Net,
    Bus,
    Axis,
}

const FIELDS: &[&str] = &["version", "net", "bus", "axis"];

impl Settings {
    /// What the keys stand for that a document does not have. It does not hold: there is no bus.
    pub(super) fn blank() -> Self {
        Self { version: VERSION, net: Net::default(), buses: Vec::new(), axes: Vec::new() }
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
            }
        }
        if seen.get(Field::Bus as usize) == Some(&true) {
            Ok(())
        } else {
            Err(A::Error::missing_field("bus"))
        }
    }

    /// Compact: all there is, in its order.
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        let missing = || A::Error::custom("the document is cut off");
        let settings = self.0;
        settings.version = seq.next_element()?.ok_or_else(missing)?;
        settings.net = seq.next_element()?.ok_or_else(missing)?;
        seq.next_element_seed(List(&mut settings.buses))?.ok_or_else(missing)?;
        seq.next_element_seed(List(&mut settings.axes))?.ok_or_else(missing)
    }
}

/// Where buses or axes are read to.
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
