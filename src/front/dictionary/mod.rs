//! What the data sheets of nodes tell of their objects: names, types, limits. Kept in memory, until the gateway starts anew.

mod record;
mod store;

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use puente_canopen::Address;
use puente_cia309::value::DataType;
use puente_eds::{Entry, Error, Reader};
use static_cell::{ConstStaticCell, StaticCell};

pub(super) use record::Record;
use store::Store;
pub(super) use store::{Held, Whose};

/// A type's name in CiA 309-3, and what is meant by it.
pub(super) type Named = (&'static str, DataType);

/// How bytes are said of which no type is known.
pub(super) const HEX: Named = ("hex", DataType::Hex);

/// The type of a name, in capitals or not.
pub(super) fn named(name: &str) -> Option<Named> {
    DataType::names().find(|(known, _)| known.eq_ignore_ascii_case(name))
}

/// How the values of a data type are said.
fn said(kind: puente_eds::DataType) -> Named {
    use puente_eds::DataType as Kind;
    let name = match kind {
        Kind::BOOLEAN => "b",
        Kind::INTEGER8 => "i8",
        Kind::INTEGER16 => "i16",
        Kind::INTEGER32 => "i32",
        Kind::INTEGER64 => "i64",
        Kind::UNSIGNED8 => "u8",
        Kind::UNSIGNED16 => "u16",
        Kind::UNSIGNED32 => "u32",
        Kind::UNSIGNED64 => "u64",
        Kind::REAL32 => "r32",
        Kind::REAL64 => "r64",
        Kind::VISIBLE_STRING => "vs",
        Kind::OCTET_STRING => "os",
        Kind::UNICODE_STRING => "us",
        Kind::DOMAIN => "d",
        _ => "hex",
    };
    named(name).unwrap_or(HEX)
}

/// Everything that is known of nodes' objects.
pub(super) struct Dictionaries {
    store: Mutex<CriticalSectionRawMutex, RefCell<&'static mut Store>>,
    /// There is one: who has it sends a file.
    readers: Channel<CriticalSectionRawMutex, &'static mut Reader, 1>,
}

impl Dictionaries {
    /// Without any. Call it once.
    pub fn new() -> Self {
        static STORE: ConstStaticCell<Store> = ConstStaticCell::new(Store::new());
        static READER: StaticCell<Reader> = StaticCell::new();
        Self::with(STORE.take(), READER.init_with(Reader::new))
    }

    fn with(store: &'static mut Store, reader: &'static mut Reader) -> Self {
        let readers = Channel::new();
        // There is room for it.
        let _ = readers.try_send(reader);
        Self { store: Mutex::new(RefCell::new(store)), readers }
    }

    fn lock<T>(&self, f: impl FnOnce(&mut Store) -> T) -> T {
        self.store.lock(|store| f(&mut store.borrow_mut()))
    }

    /// What there is of a node.
    pub fn held(&self, whose: Whose) -> Option<Held> {
        self.lock(|store| store.held(whose))
    }

    /// Takes in a file of a node, in place of what there was; none while another one comes.
    pub fn begin(&self, whose: Whose) -> Option<Upload<'_>> {
        let reader = self.readers.try_receive().ok()?;
        *reader = Reader::new();
        self.lock(|store| store.begin(whose));
        Some(Upload { all: self, reader: Some(reader) })
    }

    /// Forgets what there is of a node.
    pub fn forget(&self, whose: Whose) {
        self.lock(|store| store.remove(whose));
    }

    /// How the value of an object is said; in hex where its type is not known.
    pub fn kind(&self, whose: Whose, address: Address) -> Named {
        self.look(whose, address, |found| found.kind()).unwrap_or(HEX)
    }

    /// Shows what is known of an object, if anything.
    pub fn look<T>(&self, whose: Whose, address: Address, show: impl FnOnce(Found<'_>) -> T) -> Option<T> {
        self.lock(|store| {
            let has = |record: &Record<'_>| record.is_object() && record.has(address);
            let object = store.records(whose).find(has)?;
            Some(show(found(store, whose, object, address)))
        })
    }

    /// Shows the objects one after the other, each with the address of the first where several are alike: the one with
    /// this number, from 0 on.
    pub fn nth<T>(&self, whose: Whose, number: usize, show: impl FnOnce(Found<'_>) -> T) -> Option<T> {
        self.lock(|store| {
            let object = store.records(whose).filter(Record::is_object).nth(number)?;
            Some(show(found(store, whose, object, Address::new(object.index, object.first))))
        })
    }
}

fn found<'b>(store: &'b Store, whose: Whose, object: Record<'b>, address: Address) -> Found<'b> {
    let names = || store.records(whose).filter(|record| record.index == address.index);
    let group = names().find(Record::names_whole).map(|record| record.name);
    let own = names().find(|record| record.names_value() && record.has(address)).unwrap_or(object);
    Found { object, group, name: Some(own.name).filter(|name| !name.is_empty()) }
}

/// What is known of an object.
pub(super) struct Found<'b> {
    /// What its own section tells.
    pub object: Record<'b>,
    /// The name of the array or record that it is in.
    pub group: Option<&'b str>,
    /// Its own, where it has one.
    pub name: Option<&'b str>,
}

impl Found<'_> {
    /// How its value is said.
    pub fn kind(&self) -> Named {
        said(self.object.kind)
    }
}

/// A file on its way. Dropped before its end, nothing is kept of it.
pub(super) struct Upload<'d> {
    all: &'d Dictionaries,
    reader: Option<&'static mut Reader>,
}

impl Upload<'_> {
    /// The next bytes of the file.
    pub fn push(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let all = self.all;
        let mut add = |entry: Entry<'_>| all.lock(|store| store.add(&entry));
        self.reader.as_mut().map_or(Ok(()), |reader| reader.push(bytes, &mut add))
    }

    /// The file has ended: what is kept of it.
    pub fn end(mut self) -> Result<Option<Held>, Error> {
        let all = self.all;
        let mut add = |entry: Entry<'_>| all.lock(|store| store.add(&entry));
        self.reader.as_mut().map_or(Ok(()), |reader| reader.end(&mut add))?;
        Ok(all.lock(Store::end))
    }
}

impl Drop for Upload<'_> {
    fn drop(&mut self) {
        self.all.lock(Store::give_up);
        if let Some(reader) = self.reader.take() {
            // There is room for it.
            let _ = self.all.readers.try_send(reader);
        }
    }
}

#[cfg(test)]
mod tests;
