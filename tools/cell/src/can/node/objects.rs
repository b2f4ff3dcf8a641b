//! The values of an object dictionary.

use std::collections::BTreeMap;

use puente_canopen::Address;
use puente_canopen::sdo::Abort;
use puente_drives::cia402::Object;
use puente_drives::cia402::object::Kind;

/// Who may do what with an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read it.
    Read,
    /// Read and write it.
    Write,
    /// Read it, also in a PDO.
    ReadMapped,
    /// Read and write it, also in PDOs.
    WriteMapped,
}

impl Access {
    fn writes(self) -> bool {
        matches!(self, Self::Write | Self::WriteMapped)
    }
}

/// What an object is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Type {
    Number(Kind),
    /// Text, or a domain: any length.
    Bytes,
}

#[derive(Clone, Debug)]
struct Entry {
    kind: Type,
    access: Access,
    value: Vec<u8>,
    default: Vec<u8>,
}

/// An object dictionary. A node reads and writes its own values as numbers; what a client may do is checked by
/// [`Objects::check`].
#[derive(Clone, Debug, Default)]
pub struct Objects {
    entries: BTreeMap<Address, Entry>,
    /// What was stored (1010h), in place of the defaults.
    stored: BTreeMap<Address, Vec<u8>>,
}

impl Objects {
    /// A number with its default.
    pub fn number(&mut self, index: u16, sub: u8, kind: Kind, access: Access, value: i64) {
        let value = bytes(kind, value);
        self.define(Address::new(index, sub), Type::Number(kind), access, value);
    }

    /// An object of CiA 402 with its default.
    pub fn object(&mut self, object: Object, access: Access, value: i64) {
        self.number(object.address.index, object.address.sub, object.kind, access, value);
    }

    /// The number of sub-indexes of an index: its sub-index 0.
    pub fn count(&mut self, index: u16, subs: u8) {
        self.number(index, 0, Kind::U8, Access::Read, subs.into());
    }

    /// A text or domain with its default.
    pub fn bytes(&mut self, index: u16, sub: u8, access: Access, value: &[u8]) {
        self.define(Address::new(index, sub), Type::Bytes, access, value.to_vec());
    }

    fn define(&mut self, address: Address, kind: Type, access: Access, value: Vec<u8>) {
        let default = value.clone();
        self.entries.insert(address, Entry { kind, access, value, default });
    }

    /// All values as after power-on: those that were stored, and the defaults.
    pub fn restore(&mut self, indexes: std::ops::RangeInclusive<u16>) {
        for (address, object) in self.entries.iter_mut().filter(|(at, _)| indexes.contains(&at.index)) {
            object.value = self.stored.get(address).unwrap_or(&object.default).clone();
        }
    }

    /// From now on power-on finds the values of now (1010h), of what may be written.
    pub fn store(&mut self) {
        let written = self.entries.iter().filter(|(_, object)| object.access.writes());
        self.stored = written.map(|(at, object)| (*at, object.value.clone())).collect();
    }

    /// From now on power-on finds the defaults (1011h).
    pub fn forget(&mut self) {
        self.stored.clear();
    }

    /// The value with which power-on would begin.
    pub fn at_power_on(&self, object: Object) -> i64 {
        let stored = self.stored.get(&object.address);
        let value = stored.or_else(|| self.entries.get(&object.address).map(|entry| &entry.default));
        value.and_then(|value| object.kind.read(value)).unwrap_or(0)
    }

    /// The bytes of an object.
    ///
    /// # Errors
    /// That there is none.
    pub fn read(&self, address: Address) -> Result<&[u8], Abort> {
        self.entry(address).map(|object| object.value.as_slice())
    }

    /// A number of the node's own; 0 where there is none.
    pub fn get(&self, address: Address) -> i64 {
        let Some(object) = self.entries.get(&address) else { return 0 };
        match object.kind {
            Type::Number(kind) => kind.read(&object.value).unwrap_or(0),
            Type::Bytes => 0,
        }
    }

    /// The value of an object of CiA 402; 0 where there is none.
    pub fn value(&self, object: Object) -> i64 {
        self.get(object.address)
    }

    /// Sets a number of the node's own, where there is one; what its type cannot hold is brought into it.
    pub fn set(&mut self, address: Address, value: i64) {
        if let Some(object) = self.entries.get_mut(&address)
            && let Type::Number(kind) = object.kind
        {
            object.value = bytes(kind, value);
        }
    }

    /// As [`Objects::set`].
    pub fn put(&mut self, object: Object, value: i64) {
        self.set(object.address, value);
    }

    /// What a client has written, which has been checked.
    pub fn write(&mut self, address: Address, value: &[u8]) {
        if let Some(object) = self.entries.get_mut(&address) {
            object.value = value.to_vec();
        }
    }

    /// Whether a client may write so many bytes, where it says how many.
    ///
    /// # Errors
    /// Why not.
    pub fn check(&self, address: Address, size: Option<usize>) -> Result<(), Abort> {
        let object = self.entry(address)?;
        if !object.access.writes() {
            return Err(Abort::READ_ONLY);
        }
        match (self.length(address), size) {
            (Some(length), Some(size)) if size > length => Err(Abort::TOO_LONG),
            (Some(length), Some(size)) if size < length => Err(Abort::TOO_SHORT),
            _ => Ok(()),
        }
    }

    /// The bytes of an object that is a number.
    pub fn length(&self, address: Address) -> Option<usize> {
        match self.entries.get(&address)?.kind {
            Type::Number(kind) => Some(kind.size()),
            Type::Bytes => None,
        }
    }

    /// Whether an object may be in a PDO: in one that the node receives, or transmits.
    ///
    /// # Errors
    /// Why not.
    pub fn check_mapped(&self, address: Address, receives: bool) -> Result<usize, Abort> {
        let object = self.entry(address)?;
        match object.access {
            Access::WriteMapped => {}
            Access::ReadMapped if !receives => {}
            _ => return Err(Abort::NOT_MAPPABLE),
        }
        Ok(object.value.len())
    }

    fn entry(&self, address: Address) -> Result<&Entry, Abort> {
        self.entries.get(&address).ok_or_else(|| {
            let index = Address::new(address.index, 0)..=Address::new(address.index, u8::MAX);
            match self.entries.range(index).next() {
                Some(_) => Abort::NO_SUB_INDEX,
                None => Abort::NO_OBJECT,
            }
        })
    }
}

/// A value as an object has it.
fn bytes(kind: Kind, value: i64) -> Vec<u8> {
    let (low, high) = match kind {
        Kind::U8 => (0, u8::MAX.into()),
        Kind::I8 => (i8::MIN.into(), i8::MAX.into()),
        Kind::U16 => (0, u16::MAX.into()),
        Kind::I16 => (i16::MIN.into(), i16::MAX.into()),
        Kind::U32 => (0, u32::MAX.into()),
        Kind::I32 => (i32::MIN.into(), i32::MAX.into()),
    };
    value.clamp(low, high).to_le_bytes()[..kind.size()].to_vec()
}
