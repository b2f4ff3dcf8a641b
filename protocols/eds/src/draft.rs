//! An object whose section has not ended yet.

use heapless::String;

use crate::number::unsigned;
use crate::{Access, DataType, Entry, Mistake, NAME, Object, VALUE};

/// Object codes (7.4.3 of CiA 301, table 42).
const DOMAIN: u8 = 2;
const DEFSTRUCT: u8 = 6;
const ARRAY: u8 = 8;
const RECORD: u8 = 9;

/// What has been said of an object.
#[derive(Clone, Debug, Default)]
pub(crate) struct Draft {
    name: String<NAME>,
    object: Option<u8>,
    kind: DataType,
    access: Option<Access>,
    pdo: bool,
    low: String<VALUE>,
    high: String<VALUE>,
    default: String<VALUE>,
    value: String<VALUE>,
    /// How many values it has, each with a section of its own.
    subs: u8,
    /// How many values it has that are alike.
    alike: u8,
}

impl Draft {
    /// Takes a line in. Keys that nobody needs are passed over.
    pub(crate) fn line(&mut self, key: &str, value: &str) -> Result<(), Mistake> {
        let is = |name: &str| key.eq_ignore_ascii_case(name);
        match () {
            () if is("ParameterName") => copy(value, &mut self.name),
            () if is("ObjectType") => self.object = number(value)?,
            () if is("DataType") => self.kind = DataType(number(value)?.unwrap_or(0)),
            () if is("AccessType") => self.access = access(value)?,
            () if is("PDOMapping") => self.pdo = number::<u8>(value)?.is_some_and(|able| able != 0),
            () if is("LowLimit") => copy(value, &mut self.low),
            () if is("HighLimit") => copy(value, &mut self.high),
            () if is("DefaultValue") => copy(value, &mut self.default),
            () if is("ParameterValue") => copy(value, &mut self.value),
            () if is("SubNumber") => self.subs = number(value)?.unwrap_or(0),
            () if is("CompactSubObj") => self.alike = number(value)?.unwrap_or(0),
            () => {}
        }
        Ok(())
    }

    /// The section `[index]` ends: what it has told.
    pub(crate) fn object(&self, index: u16, take: &mut impl FnMut(Entry<'_>)) {
        let name = &self.name;
        if self.alike > 0 {
            take(Entry::Name { index, sub: None, name });
            let count = Object {
                name: "",
                kind: DataType::UNSIGNED8,
                access: Some(Access::Ro),
                pdo: false,
                low: "",
                high: "",
                default: "",
                value: "",
                ..self.values(index, 0, 0)
            };
            take(Entry::Object(count));
            take(Entry::Object(Object { name: "", ..self.values(index, 1, self.alike) }));
        } else if self.subs > 0 || matches!(self.object, Some(DEFSTRUCT | ARRAY | RECORD)) {
            take(Entry::Name { index, sub: None, name });
        } else {
            take(Entry::Object(self.values(index, 0, 0)));
        }
    }

    /// The section `[indexsubN]` ends.
    pub(crate) fn sub(&self, index: u16, sub: u8, take: &mut impl FnMut(Entry<'_>)) {
        take(Entry::Object(self.values(index, sub, sub)));
    }

    fn values(&self, index: u16, first: u8, last: u8) -> Object<'_> {
        let kind = match self.object {
            Some(DOMAIN) if self.kind == DataType::default() => DataType::DOMAIN,
            _ => self.kind,
        };
        Object {
            index,
            first,
            last,
            name: &self.name,
            kind,
            access: self.access,
            pdo: self.pdo,
            low: &self.low,
            high: &self.high,
            default: &self.default,
            value: &self.value,
        }
    }
}

/// As much of the text as there is room for.
pub(crate) fn copy<const N: usize>(text: &str, to: &mut String<N>) {
    to.clear();
    for letter in text.chars() {
        if to.push(letter).is_err() {
            break;
        }
    }
}

/// A number, where there is one.
fn number<T: TryFrom<u64>>(text: &str) -> Result<Option<T>, Mistake> {
    if text.is_empty() {
        return Ok(None);
    }
    let number = unsigned(text).and_then(|number| T::try_from(number).ok());
    number.ok_or(Mistake::Number).map(Some)
}

fn access(text: &str) -> Result<Option<Access>, Mistake> {
    if text.is_empty() {
        return Ok(None);
    }
    Access::parse(text).ok_or(Mistake::Access).map(Some)
}
