//! A value that is written to a node: `["0x6083", 0, "u32", 10000]` in a document.

use core::fmt::{self, Write as _};
use core::str::FromStr;

use heapless::String;
use puente_canopen::Address;
use serde::de::{Error, SeqAccess, Unexpected, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::Text;

/// A value that is written to a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Write {
    /// Where.
    pub address: Address,
    /// What.
    pub value: Value,
}

/// A value with its type, under the names of CiA 309-3.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum Value {
    I8(i8),
    I16(i16),
    I32(i32),
    I64(i64),
    U8(u8),
    U16(u16),
    U32(u32),
    U64(u64),
    R32(f32),
    R64(f64),
}

#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    I8,
    I16,
    I32,
    I64,
    U8,
    U16,
    U32,
    U64,
    R32,
    R64,
}

impl Value {
    /// Its bytes on the bus, the low one first, and how many of the eight they are.
    pub fn bytes(&self) -> ([u8; 8], usize) {
        fn few<const N: usize>(bytes: [u8; N]) -> ([u8; 8], usize) {
            let mut eight = [0; 8];
            eight.iter_mut().zip(bytes).for_each(|(to, from)| *to = from);
            (eight, N)
        }
        match *self {
            Value::I8(value) => few(value.to_le_bytes()),
            Value::I16(value) => few(value.to_le_bytes()),
            Value::I32(value) => few(value.to_le_bytes()),
            Value::I64(value) => few(value.to_le_bytes()),
            Value::U8(value) => few(value.to_le_bytes()),
            Value::U16(value) => few(value.to_le_bytes()),
            Value::U32(value) => few(value.to_le_bytes()),
            Value::U64(value) => few(value.to_le_bytes()),
            Value::R32(value) => few(value.to_le_bytes()),
            Value::R64(value) => few(value.to_le_bytes()),
        }
    }

    const fn kind(&self) -> Kind {
        match self {
            Value::I8(_) => Kind::I8,
            Value::I16(_) => Kind::I16,
            Value::I32(_) => Kind::I32,
            Value::I64(_) => Kind::I64,
            Value::U8(_) => Kind::U8,
            Value::U16(_) => Kind::U16,
            Value::U32(_) => Kind::U32,
            Value::U64(_) => Kind::U64,
            Value::R32(_) => Kind::R32,
            Value::R64(_) => Kind::R64,
        }
    }
}

/// An index as a document has it: `0x6083`, or decimal.
struct Index(u16);

impl fmt::Display for Index {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:#06X}", self.0)
    }
}

impl FromStr for Index {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let number = match text.strip_prefix("0x") {
            Some(digits) => u16::from_str_radix(digits, 16),
            None => text.parse(),
        };
        number.map(Self).map_err(|_| "an index is a text such as \"0x6083\"")
    }
}

/// Parts of the form.
const PARTS: usize = 4;

impl Serialize for Write {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let readable = serializer.is_human_readable();
        let mut parts = serializer.serialize_tuple(PARTS)?;
        if readable {
            let mut index = String::<8>::new();
            // There is room.
            let _ = write!(index, "{}", Index(self.address.index));
            parts.serialize_element(&*index)?;
        } else {
            parts.serialize_element(&self.address.index)?;
        }
        parts.serialize_element(&self.address.sub)?;
        parts.serialize_element(&self.value.kind())?;
        match &self.value {
            Value::I8(value) => parts.serialize_element(value),
            Value::I16(value) => parts.serialize_element(value),
            Value::I32(value) => parts.serialize_element(value),
            Value::I64(value) => parts.serialize_element(value),
            Value::U8(value) => parts.serialize_element(value),
            Value::U16(value) => parts.serialize_element(value),
            Value::U32(value) => parts.serialize_element(value),
            Value::U64(value) => parts.serialize_element(value),
            Value::R32(value) => parts.serialize_element(value),
            Value::R64(value) => parts.serialize_element(value),
        }?;
        parts.end()
    }
}

impl<'de> Deserialize<'de> for Write {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let readable = deserializer.is_human_readable();
        deserializer.deserialize_tuple(PARTS, Reader { readable })
    }
}

struct Reader {
    readable: bool,
}

impl<'de> Visitor<'de> for Reader {
    type Value = Write;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an index, a sub-index, a type and a value")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Write, A::Error> {
        fn next<'de, T: Deserialize<'de>, A: SeqAccess<'de>>(seq: &mut A) -> Result<T, A::Error> {
            seq.next_element()?.ok_or_else(|| A::Error::custom("a part of the write is missing"))
        }
        let index = if self.readable { next::<Text<Index>, _>(&mut seq)?.0.0 } else { next(&mut seq)? };
        let address = Address::new(index, next(&mut seq)?);
        let value = match next::<Kind, _>(&mut seq)? {
            Kind::I8 => Value::I8(next(&mut seq)?),
            Kind::I16 => Value::I16(next(&mut seq)?),
            Kind::I32 => Value::I32(next(&mut seq)?),
            Kind::I64 => Value::I64(next(&mut seq)?),
            Kind::U8 => Value::U8(next(&mut seq)?),
            Kind::U16 => Value::U16(next(&mut seq)?),
            Kind::U32 => Value::U32(next(&mut seq)?),
            Kind::U64 => Value::U64(next(&mut seq)?),
            Kind::R32 => Value::R32(next(&mut seq)?),
            Kind::R64 => Value::R64(next(&mut seq)?),
        };
        match value {
            Value::R32(value) if !value.is_finite() => {
                Err(A::Error::invalid_value(Unexpected::Float(value.into()), &"a finite number"))
            }
            Value::R64(value) if !value.is_finite() => {
                Err(A::Error::invalid_value(Unexpected::Float(value), &"a finite number"))
            }
            value => Ok(Write { address, value }),
        }
    }
}
