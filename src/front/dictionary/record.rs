//! The form in which an entry of a data sheet is kept.

use heapless::Vec;
use puente_canopen::Address;
use puente_eds::{Access, DataType, Entry, Object};

/// An object, or a name of one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::front) struct Record<'b> {
    what: What,
    pub index: u16,
    /// First and last sub-index.
    pub first: u8,
    pub last: u8,
    pub kind: DataType,
    pub access: Option<Access>,
    pub name: &'b str,
    pub low: &'b str,
    pub high: &'b str,
    pub default: &'b str,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum What {
    Object = 0,
    /// The name of a value.
    Name = 1,
    /// The name of an array or record.
    Whole = 2,
}

/// Bytes before the texts: what it is and its access, index, sub-indices, data type, and the length of each text.
const HEAD: usize = 11;

/// Writes an entry behind others; how many bytes that are, or none where it does not fit.
pub(super) fn write<const N: usize>(entry: &Entry<'_>, bytes: &mut Vec<u8, N>) -> Option<usize> {
    let blank = Object {
        index: 0,
        first: 0,
        last: 0,
        name: "",
        kind: DataType(0),
        access: None,
        pdo: false,
        low: "",
        high: "",
        default: "",
        value: "",
    };
    let (what, object) = match *entry {
        Entry::Object(object) => (What::Object, object),
        Entry::Name { index, sub: None, name } => (What::Whole, Object { index, name, ..blank }),
        Entry::Name { index, sub: Some(sub), name } => {
            (What::Name, Object { index, first: sub, last: sub, name, ..blank })
        }
    };
    let access =
        Access::ALL.iter().position(|access| Some(*access) == object.access).map_or(0, |at| at as u8 + 1);
    let [low, high] = object.index.to_le_bytes();
    let [kind_low, kind_high] = object.kind.0.to_le_bytes();
    let texts = [object.name, object.low, object.high, object.default];
    let lengths = texts.map(|text| text.len() as u8);
    let head = [(what as u8) << 4 | access, low, high, object.first, object.last, kind_low, kind_high];
    let length = HEAD + texts.iter().map(|text| text.len()).sum::<usize>();
    if bytes.capacity() - bytes.len() < length {
        return None;
    }
    let pieces = [&head[..], &lengths[..]].into_iter().chain(texts.iter().map(|text| text.as_bytes()));
    for piece in pieces {
        bytes.extend_from_slice(piece).ok()?;
    }
    Some(length)
}

impl<'b> Record<'b> {
    /// The first one, and what follows it.
    pub fn read(bytes: &'b [u8]) -> Option<(Self, &'b [u8])> {
        let (head, mut rest) = bytes.split_first_chunk::<HEAD>()?;
        let [what, low, high, first, last, kind_low, kind_high, lengths @ ..] = *head;
        let mut text = |length: u8| {
            let (text, others) = rest.split_at_checked(length.into())?;
            rest = others;
            core::str::from_utf8(text).ok()
        };
        let [name, lowest, highest, default] = lengths;
        let record = Self {
            what: match what >> 4 {
                0 => What::Object,
                1 => What::Name,
                _ => What::Whole,
            },
            index: u16::from_le_bytes([low, high]),
            first,
            last,
            kind: DataType(u16::from_le_bytes([kind_low, kind_high])),
            access: usize::from(what & 15).checked_sub(1).and_then(|at| Access::ALL.get(at).copied()),
            name: text(name)?,
            low: text(lowest)?,
            high: text(highest)?,
            default: text(default)?,
        };
        Some((record, rest))
    }

    pub fn is_object(&self) -> bool {
        self.what == What::Object
    }

    /// Whether it is the name of an array or record as a whole.
    pub fn names_whole(&self) -> bool {
        self.what == What::Whole
    }

    /// Whether it is the name of a value.
    pub fn names_value(&self) -> bool {
        self.what == What::Name
    }

    pub fn has(&self, address: Address) -> bool {
        self.index == address.index && (self.first..=self.last).contains(&address.sub)
    }
}
