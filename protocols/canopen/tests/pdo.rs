//! PDO parameters, the order in which they are written and read, and the values in PDOs.

mod common;

use proptest::prelude::*;
use puente_canopen::pdo::{
    self, BadAnswer, BadSetup, CobId, Direction, Mapped, Pdo, Reader, Reserved, Setup, Transmission, Write,
};
use puente_canopen::{Address, Id};

fn receive(number: u16) -> Pdo {
    Pdo::new(Direction::Receive, number).expect("a number")
}

fn transmit(number: u16) -> Pdo {
    Pdo::new(Direction::Transmit, number).expect("a number")
}

const SET_POINT: Mapped = Mapped::new(0x60C1, 1, 32);

/// `address = value / bytes`.
fn lines(setup: &Setup<'_>) -> Vec<String> {
    let line = |write: Write| format!("{} = {:X} / {}", write.address, write.value, write.size);
    setup.writes().expect("a good setup").map(line).collect()
}

#[test]
fn a_remapping_keeps_the_order_of_the_standard() {
    // The set-point of the IP mode on RPDO4, of the thesis (001, 6.4.4).
    let mapping = [SET_POINT];
    let mut setup = Setup::new(receive(4), CobId::new(0x502));
    setup.mapping = Some(&mapping);
    setup.transmission = Some(Transmission::SyncCyclic(1));
    let expected = [
        "1403h:1 = C0000502 / 4",
        "1603h:0 = 0 / 1",
        "1603h:1 = 60C10120 / 4",
        "1603h:0 = 1 / 1",
        "1403h:2 = 1 / 1",
        "1403h:1 = 40000502 / 4",
    ];
    assert_eq!(lines(&setup), expected);
    let mut setup = Setup::new(transmit(1), CobId::new(0x1FF));
    setup.now = Some(CobId::new(0x182));
    setup.inhibit = Some(100);
    setup.event_timer = Some(1_000);
    setup.sync_start = Some(0);
    let expected = [
        "1800h:1 = C0000182 / 4",
        "1800h:3 = 64 / 2",
        "1800h:5 = 3E8 / 2",
        "1800h:6 = 0 / 1",
        "1800h:1 = 400001FF / 4",
    ];
    assert_eq!(lines(&setup), expected);
    // 001, 6.4.1: "23 - 00 - 14 - 01 - 02 - 02 - 00 - 40".
    let thesis = Setup::new(receive(1), CobId::new(0x202)).writes().expect("good").last().expect("a write");
    assert_eq!((thesis.address, thesis.bytes()), (Address::new(0x1400, 1), [0x02, 0x02, 0x00, 0x40]));
    let off = Setup::new(receive(1), CobId::new(0x202).invalid());
    assert_eq!(lines(&off), ["1400h:1 = C0000202 / 4"]);
    assert_eq!(lines(&Setup { now: Some(CobId::new(0x203)), ..off }).len(), 2);
}

#[test]
fn what_cannot_be_is_refused() {
    let error = |setup: Setup<'_>| setup.writes().err();
    let plain = Setup::new(receive(1), CobId::new(0x202));
    assert_eq!(error(plain), None);
    let long = [Mapped::new(0x607A, 0, 32), Mapped::new(0x60FF, 0, 32), Mapped::new(0x6040, 0, 1)];
    assert_eq!(error(Setup { mapping: Some(&long), ..plain }), Some(BadSetup::Length { bits: 65 }));
    assert_eq!(error(Setup { mapping: Some(&long[..2]), ..plain }), None);
    let none = [Mapped::new(0x607A, 0, 0)];
    assert_eq!(error(Setup { mapping: Some(&none), ..plain }), Some(BadSetup::Length { bits: 0 }));
    let many = [Mapped::new(0x6040, 0, 1); 65];
    assert_eq!(error(Setup { mapping: Some(&many), ..plain }), Some(BadSetup::TooMany));
    let other = Setup { cob_id: CobId::new(0x602), ..plain };
    assert_eq!(error(other), Some(BadSetup::Restricted { id: 0x602 }));
    assert_eq!(error(Setup { sync_start: Some(1), ..plain }), Some(BadSetup::SyncStart));
    assert_eq!((Pdo::new(Direction::Receive, 0), Pdo::new(Direction::Receive, 513)), (None, None));
    assert_eq!(transmit(512).mapping(1), Address::new(0x1BFF, 1));
}

#[test]
fn entries() {
    assert_eq!(CobId::from_raw(0x8000_0202), CobId { valid: false, remote: true, id: Id::Base(0x202) });
    assert_eq!(CobId::from_raw(0x7234_5678).id, Id::Extended(0x1234_5678));
    for code in 0..=255_u8 {
        match Transmission::from_code(code) {
            Ok(kind) => assert_eq!(kind.code(), code),
            Err(Reserved) => assert!((241..=251).contains(&code)),
        }
    }
    assert_eq!([0, 241].map(|every| Transmission::SyncCyclic(every).code()), [1, 240]);
}

#[test]
fn a_layout_is_read() {
    let mut reader = Reader::<2>::new(transmit(3));
    assert_eq!(reader.take(&[0; 3]), Err(BadAnswer::Size { address: Address::new(0x1802, 1), received: 3 }));
    let answers: [(Address, &[u8]); 5] = [
        (Address::new(0x1802, 1), &[0x82, 0x03, 0, 0x40]),
        (Address::new(0x1802, 2), &[255]),
        (Address::new(0x1A02, 0), &[2]),
        (Address::new(0x1A02, 1), &[16, 0, 0x41, 0x60]),
        (Address::new(0x1A02, 2), &[32, 0, 0x64, 0x60]),
    ];
    for (address, value) in answers {
        assert_eq!((reader.wants(), reader.layout()), (Some(address), None));
        reader.take(value).expect("a good answer");
    }
    let layout = reader.layout().expect("all of it");
    assert_eq!(reader.wants(), None);
    assert_eq!((layout.cob_id, layout.transmission), (CobId::new(0x382), Some(Transmission::EventProfile)));
    assert_eq!(layout.mapping, [Mapped::new(0x6041, 0, 16), Mapped::new(0x6064, 0, 32)]);

    let mut reader = Reader::<2>::new(receive(1));
    reader.take(&[0; 4]).expect("a COB-ID");
    reader.take(&[245]).expect("a type, though reserved");
    assert_eq!(reader.take(&[3]), Err(BadAnswer::TooMany { count: 3 }));
    assert_eq!(reader.take(&[0]), Ok(()));
    assert_eq!(reader.layout().map(|layout| (layout.transmission, layout.mapping.len())), Some((None, 0)));
}

#[test]
fn values_in_the_pdos_of_the_thesis() {
    let rpdo3 = [Mapped::new(0x6040, 0, 16), Mapped::new(0x607A, 0, 32)];
    let mut data = [0; 8];
    assert!(pdo::put(&rpdo3, &mut data, Address::new(0x6040, 0), 0x000F));
    assert!(pdo::put(&rpdo3, &mut data, Address::new(0x607A, 0), 0x0050_4030));
    assert!(!pdo::put(&rpdo3, &mut data, Address::new(0x60FF, 0), 1));
    // "402, 6, 0F - 00 - 30 - 40 - 50 - 00".
    assert_eq!(
        (data[..pdo::bytes(&rpdo3)].to_vec(), data[6..].to_vec()),
        (vec![0x0F, 0, 0x30, 0x40, 0x50, 0], vec![0, 0])
    );
    // "282, 3, 37 - 92 - 06".
    let tpdo2 = [Mapped::new(0x6041, 0, 16), Mapped::new(0x6061, 0, 8)];
    let values: Vec<_> = pdo::values(&tpdo2, &[0x37, 0x92, 0x06]).map(|(_, value)| value).collect();
    assert_eq!(values, [0x9237, 6]);
    assert_eq!(pdo::value(&tpdo2, &[0x37, 0x92], Address::new(0x6061, 0)), None, "too short");
    // Bits, and a negative number.
    let bits = [Mapped::new(0x2000, 1, 3), Mapped::new(0x2000, 2, 7), Mapped::new(0x2000, 3, 16)];
    let mut data = [0; 8];
    for (sub, value) in [(1, 5), (2, 0x55), (3, i16::from_le_bytes([0xFE, 0xFF]) as u64)] {
        assert!(pdo::put(&bits, &mut data, Address::new(0x2000, sub), value));
    }
    assert_eq!(pdo::bytes(&bits), 4);
    let values: Vec<_> = pdo::values(&bits, &data[..4]).map(|(_, value)| value).collect();
    assert_eq!(values, [5, 0x55, 0xFFFE]);
}

proptest! {
    #[test]
    fn what_is_put_is_there(
        lengths in prop::collection::vec(1..=64_u8, 1..10), numbers in prop::collection::vec(any::<u64>(), 10),
        before: [u8; 8], data in prop::collection::vec(any::<u8>(), 0..10),
    ) {
        let mapping: Vec<_> = (0..).zip(&lengths).map(|(sub, bits)| Mapped::new(0x2000, sub, *bits)).collect();
        let mut frame = before;
        let mut at = 0_u32;
        let mut expected = Vec::new();
        for (mapped, number) in mapping.iter().zip(&numbers) {
            at += u32::from(mapped.bits);
            prop_assert_eq!(pdo::put(&mapping, &mut frame, mapped.address, *number), at <= 64);
            if at <= 64 {
                expected.push((*mapped, *number & (u64::MAX >> (64 - mapped.bits))));
            }
        }
        prop_assert_eq!(pdo::values(&mapping, &frame).collect::<Vec<_>>(), expected);
        prop_assert!(pdo::values(&mapping, &data).count() <= mapping.len());
    }

    #[test]
    fn entries_are_made_as_they_are_taken(raw: u32) {
        prop_assert_eq!(Mapped::from_raw(raw).raw(), raw);
        let cob_id = CobId::from_raw(raw);
        prop_assert_eq!(CobId::from_raw(cob_id.raw()), cob_id);
    }

    /// The PDO is off before anything else is touched, and on only as the last.
    #[test]
    fn a_pdo_is_off_while_it_is_changed(number in 1..=512_u16, count in 0..=8_usize, timer: Option<u16>, valid: bool) {
        let mapping: Vec<_> = (0..count).map(|at| Mapped::new(0x2000, at as u8, 8)).collect();
        let cob_id = CobId { valid, ..CobId::new(0x300) };
        let setup = Setup { mapping: Some(&mapping), event_timer: timer, ..Setup::new(transmit(number), cob_id) };
        let writes: Vec<_> = setup.writes().expect("good").collect();
        let own = transmit(number).communication(1);
        let on: Vec<_> = writes.iter().map(|write| write.address == own && write.value >> 31 == 0).collect();
        prop_assert!(writes[0].address == own && !on[0]);
        prop_assert_eq!(on.iter().position(|on| *on), valid.then(|| writes.len() - 1));
        let counts: Vec<_> = writes.iter().filter(|write| write.address == transmit(number).mapping(0)).collect();
        prop_assert_eq!(counts.iter().map(|write| write.value as usize).collect::<Vec<_>>(), [0, count]);
    }
}
