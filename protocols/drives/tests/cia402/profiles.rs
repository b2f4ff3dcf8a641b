//! Profiles, modes, objects and checks.

use proptest::prelude::*;
use puente_canopen::Address;
use puente_canopen::pdo::{self, Mapped};
use puente_drives::cia402::check::{self, Complaint};
use puente_drives::cia402::{Kind, Mode, Period, Profile, Supported, object, parameter_of_delta};
use puente_line::Duration;

#[test]
fn profiles_have_the_pdos_of_the_thesis() {
    for profile in Profile::ALL {
        assert_eq!(Profile::named(profile.name), Some(profile));
        let bytes = |set: [&[Mapped]; 4]| set.map(pdo::bytes);
        assert_eq!((bytes(profile.receive), bytes(profile.transmit)), ([2, 3, 6, 6], [2, 3, 6, 6]));
        let raw: Vec<_> = profile.receive[2].iter().map(|mapped| mapped.raw()).collect();
        assert_eq!(raw, [0x6040_0010, 0x607A_0020]);
    }
    assert_eq!(Profile::named("siemens"), None);
    assert_eq!(Profile::INTERPOLATED, [Mapped::from_raw(0x60C1_0120)]);
    assert!(Profile::LEXIUM_23A.has(Mode::JOG) && !Profile::FESTO_CMMS.has(Mode::JOG));
    let festo = Profile::FESTO_CMMS.interpolation;
    assert!(festo.submode == -2 && festo.says_relative && festo.period_needs_reset);
}

#[test]
fn parameters_of_delta() {
    let cases = [((1, 44), 0x212C), ((3, 5), 0x2305), ((2, 10), 0x220A), ((5, 4), 0x2504)];
    for ((group, number), index) in cases {
        assert_eq!(parameter_of_delta(group, number), Some(Address::new(index, 0)));
    }
    assert_eq!(parameter_of_delta(16, 0), None);
}

#[test]
fn modes() {
    for code in i8::MIN..=i8::MAX {
        match Mode::from_code(code) {
            Some(mode) => assert_eq!(mode.code(), code),
            None => assert!(code == 5 || code > 10),
        }
    }
    assert_eq!(Mode::JOG.code(), -1);
    let all = [1, 2, 3, 4, 6, 7, 8, 9, 10].map(|code| Mode::from_code(code).expect("a mode"));
    let masks = [0x1, 0x2, 0x4, 0x8, 0x20, 0x40, 0x80, 0x100, 0x200];
    for (mode, mask) in all.into_iter().zip(masks) {
        assert!(Supported(mask).has(mode) && !Supported(!mask).has(mode), "{mode}");
    }
    assert!(!Supported(u32::MAX).has(Mode::None) && !Supported(u32::MAX).has(Mode::JOG));
}

#[test]
fn what_a_mode_controls() {
    let cases = [
        (Mode::ProfilePosition, Some(object::TARGET_POSITION), Some(object::POSITION), 0x00),
        (Mode::Velocity, Some(object::VL_TARGET), Some(object::VELOCITY), 0x70),
        (Mode::ProfileVelocity, Some(object::TARGET_VELOCITY), Some(object::VELOCITY), 0x00),
        (Mode::ProfileTorque, Some(object::TARGET_TORQUE), Some(object::TORQUE), 0x00),
        (Mode::Homing, None, Some(object::POSITION), 0x00),
        (Mode::InterpolatedPosition, Some(object::INTERPOLATION_SET_POINT), Some(object::POSITION), 0x10),
        (Mode::CyclicTorque, Some(object::TARGET_TORQUE), Some(object::TORQUE), 0x00),
        (Mode::JOG, None, None, 0x00),
    ];
    for (mode, target, actual, bits) in cases {
        assert_eq!((mode.target(), mode.actual(), mode.run_bits()), (target, actual, bits), "{mode}");
    }
    assert_eq!(Mode::Homing.status_bits(), (Some("homing attained"), Some("homing error")));
    assert_eq!(Mode::ProfileTorque.status_bits(), (None, None));
}

#[test]
fn periods() {
    let parts =
        |micros| Period::new(Duration::from_micros(micros)).map(|period| (period.value(), period.exponent()));
    assert_eq!(parts(1_000), Some((1, -3)));
    assert_eq!(parts(10_000), Some((1, -2)));
    assert_eq!(parts(25_000), Some((25, -3)));
    assert_eq!(parts(500), Some((5, -4)));
    assert_eq!(parts(1_500), Some((15, -4)));
    assert_eq!(parts(255), Some((255, -6)));
    assert_eq!(parts(256), None);
    assert_eq!(parts(0), None);
    assert_eq!(Period::new(Duration::from_nanos(1_000_500)), None);
    assert_eq!(Period::from_parts(10, -3).map(Period::time), Some(Duration::from_millis(10)));
    assert_eq!(
        (Period::from_parts(0, -3), Period::from_parts(1, 1), Period::from_parts(1, -7)),
        (None, None, None)
    );
}

#[test]
fn objects_have_addresses_of_their_own() {
    let addresses: std::collections::BTreeSet<_> = object::ALL.iter().map(|object| object.address).collect();
    assert_eq!(addresses.len(), object::ALL.len());
    assert_eq!(object::TARGET_POSITION.mapped().raw(), 0x607A_0020);
    assert_eq!(object::MODE.kind.read(&[0xFF]), Some(-1));
    assert_eq!(object::STATUSWORD.kind.read(&[0x37, 0x92]), Some(0x9237));
    assert_eq!(object::POSITION.kind.read(&[0xFE, 0xFF, 0xFF, 0xFF]), Some(-2));
    assert_eq!(object::POSITION.kind.read(&[0; 3]), None);
    assert!(Kind::I16.holds(-32_768) && !Kind::U16.holds(-1) && !Kind::I8.holds(128));
}

/// What a drive says whose dictionary is this.
fn complaints(profile: &Profile, dictionary: impl Fn(Address) -> Option<Vec<u8>>) -> Vec<String> {
    check::of(profile)
        .filter_map(|check| check.judge(profile, dictionary(check.object.address).as_deref()).err())
        .map(|complaint: Complaint| complaint.to_string())
        .collect()
}

#[test]
fn a_node_is_judged() {
    let lexium = |address: Address| {
        Some(match address.index {
            0x1000 => vec![0x92, 0x01, 0x02, 0x00],
            0x6502 => 0x6D_u32.to_le_bytes().to_vec(),
            _ => vec![0; object::ALL.iter().find(|object| object.address == address)?.kind.size()],
        })
    };
    assert_eq!(complaints(&Profile::LEXIUM_23A, lexium), [""; 0]);
    let io = |address: Address| match address.index {
        0x1000 => Some(vec![0x91, 0x01, 0x0F, 0x00]),
        0x6502 => Some(vec![0x2D, 0, 0, 0]),
        0x6041 => Some(vec![0; 4]),
        0x60C1 => None,
        _ => lexium(address),
    };
    let expected = [
        "no drive: its device profile is 401, not 402",
        "object 6041h:0 has 4 bytes instead of 2",
        "it does not have the mode ip",
        "object 60C1h:1 is missing",
    ];
    assert_eq!(complaints(&Profile::LEXIUM_23A, io), expected);
    // A generic drive is asked for what every drive must have.
    assert_eq!(check::of(&Profile::GENERIC).count(), 5);
    assert_eq!(complaints(&Profile::GENERIC, |_| None).len(), 5);
}

proptest! {
    #[test]
    fn values_are_read_as_they_are(value: i32) {
        let bytes = value.to_le_bytes();
        prop_assert_eq!(Kind::I32.read(&bytes), Some(i64::from(value)));
        prop_assert_eq!(Kind::U32.read(&bytes), Some(i64::from(value as u32)));
        prop_assert_eq!(Kind::I16.read(&bytes[..2]), Some(i64::from(value as i16)));
        prop_assert_eq!(Kind::I8.read(&bytes[..1]), Some(i64::from(value as i8)));
        prop_assert_eq!(Kind::I16.holds(i64::from(value)), i16::try_from(value).is_ok());
    }

    #[test]
    fn a_period_is_exact(micros in 0..100_000_000_u64) {
        let time = Duration::from_micros(micros);
        if let Some(period) = Period::new(time) {
            prop_assert_eq!(period.time(), time);
            prop_assert_eq!(Period::from_parts(period.value(), period.exponent()), Some(period));
        }
    }
}
