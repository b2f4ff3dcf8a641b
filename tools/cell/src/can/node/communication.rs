//! The communication profile's part of the object dictionary (1000h to 1FFFh).

use puente_canopen::lss::{Identity, Part};
use puente_canopen::pdo::{CobId, Direction, Mapped, Pdo};
use puente_canopen::{Address, NodeId};
use puente_drives::cia402::object::Kind::{U8, U16, U32};

use super::objects::Access::{Read, Write};
use super::{Model, Objects};

/// PDOs of each direction.
pub const PDOS: u16 = 4;
/// Objects that a PDO can have.
pub const MAPPED: u8 = 8;
/// Nodes whose heartbeat may be watched.
pub const CONSUMERS: u8 = 4;
/// Least time between two of transmit PDO 3 and 4 as delivered, *assumed*: their values change all the time, 100 us.
const INHIBIT: i64 = 100;

/// "save" and "load", the keys of 1010h and 1011h, the first letter in the low byte.
pub const SAVE: u32 = u32::from_le_bytes(*b"save");
/// See [`SAVE`].
pub const LOAD: u32 = u32::from_le_bytes(*b"load");

/// Defines all of it.
pub fn define(objects: &mut Objects, model: Model, id: NodeId, identity: Identity) {
    let device_type = match model.profile() {
        // Servo drive.
        Some(_) => 0x0002_0192,
        None => 0,
    };
    objects.number(0x1000, 0, U32, Read, device_type);
    if model == Model::Node {
        // Something of any length to read and write.
        objects.bytes(0x2000, 0, Write, b"");
    }
    objects.number(0x1001, 0, U8, Read, 0);
    objects.number(0x1003, 0, U8, Write, 0);
    for entry in 1..=model.errors() {
        objects.number(0x1003, entry, U32, Read, 0);
    }
    objects.number(0x1005, 0, U32, Write, 0x80);
    objects.number(0x1006, 0, U32, Write, 0);
    objects.bytes(0x1008, 0, Read, format!("simulated {}", model.name()).as_bytes());
    objects.bytes(0x1009, 0, Read, b"1");
    objects.bytes(0x100A, 0, Read, env!("CARGO_PKG_VERSION").as_bytes());
    objects.number(0x100C, 0, U16, Write, 0);
    objects.number(0x100D, 0, U8, Write, 0);
    for index in [0x1010, 0x1011] {
        objects.count(index, 1);
        objects.number(index, 1, U32, Write, 1);
    }
    objects.number(0x1014, 0, U32, Write, id.emcy().into());
    objects.number(0x1015, 0, U16, Write, 0);
    objects.count(0x1016, CONSUMERS);
    for entry in 1..=CONSUMERS {
        objects.number(0x1016, entry, U32, Write, 0);
    }
    objects.number(0x1017, 0, U16, Write, 0);
    define_identity(objects, identity);
    objects.number(0x1019, 0, U8, Write, 0);
    objects.count(0x1029, 1);
    objects.number(0x1029, 1, U8, Write, 0);
    objects.count(0x1200, 2);
    objects.number(0x1200, 1, U32, Read, id.sdo_request().into());
    objects.number(0x1200, 2, U32, Read, id.sdo_response().into());
    for number in 1..=PDOS {
        pdo(objects, model, id, Direction::Receive, number);
        pdo(objects, model, id, Direction::Transmit, number);
    }
}

/// Who the node says that it is.
pub fn define_identity(objects: &mut Objects, identity: Identity) {
    objects.count(0x1018, 4);
    for part in Part::ALL {
        objects.number(0x1018, part as u8 + 1, U32, Read, identity.part(part).into());
    }
}

fn pdo(objects: &mut Objects, model: Model, id: NodeId, direction: Direction, number: u16) {
    let Some(pdo) = Pdo::new(direction, number) else { return };
    let cob_id = match direction {
        Direction::Receive => id.rpdo(number),
        Direction::Transmit => id.tpdo(number),
    };
    let off = model.profile().is_none_or(|profile| profile.pdos_off);
    let cob_id = CobId { valid: !off, ..CobId::new(cob_id.unwrap_or(0)) };
    let parameter = pdo.communication(0).index;
    objects.number(parameter, 1, U32, Write, cob_id.raw().into());
    objects.number(parameter, 2, U8, Write, 255);
    match direction {
        Direction::Receive => objects.count(parameter, 2),
        Direction::Transmit => {
            objects.count(parameter, 6);
            objects.number(parameter, 3, U16, Write, if number > 2 { INHIBIT } else { 0 });
            objects.number(parameter, 5, U16, Write, 0);
            objects.number(parameter, 6, U8, Write, 0);
        }
    }
    let set = model.profile().map(|profile| match direction {
        Direction::Receive => profile.receive,
        Direction::Transmit => profile.transmit,
    });
    let mapped: &[Mapped] = set.map_or(&[], |set| set[usize::from(number) - 1]);
    let mapping = pdo.mapping(0).index;
    objects.number(mapping, 0, U8, Write, mapped.len() as i64);
    for entry in 1..=MAPPED {
        let raw = mapped.get(usize::from(entry) - 1).map_or(0, |mapped| mapped.raw());
        objects.number(mapping, entry, U32, Write, raw.into());
    }
}

/// The error history is emptied.
pub fn clear_errors(objects: &mut Objects) {
    for sub in 0..=u8::MAX {
        objects.set(Address::new(0x1003, sub), 0);
    }
}
