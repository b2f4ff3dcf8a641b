//! Settings: by hand, and their properties.

use proptest::collection::vec;
use proptest::prelude::*;
use puente_drives::pid::Gains;
use puente_framed::frame;
use puente_modules::setting::{self, DataError, Form, MAX_SET_POINT, Setting};
use puente_modules::{Control, Order, Report};

/// Bytes written in hexadecimal, with comments from `#` on.
fn hex(text: &str) -> Vec<u8> {
    let code = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let bytes = code.flat_map(str::split_whitespace);
    bytes.map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect()
}

/// 3 axes of 255 bytes.
#[test]
fn a_frame_of_the_thesis_has_settings() {
    let bytes = hex(include_str!("../../framed/tests/thesis.hex"));
    let frame = frame::parse(&bytes).expect("a frame");
    let setting = |kp, ki, kd, set_point| Setting { kp, ki, kd, set_point, order: None };
    for (address, setting, counts) in [
        (17, setting(2.5, 0.05, 0.001, 12_000.0), Some(12_000)),
        (18, setting(1.75, 0.1, 0.0, -340.5), Some(-341)),
        (19, setting(10.0, 2.0, 0.25, 99_999_999.0), None),
    ] {
        let section = frame.section_for(address).expect("a section");
        assert_eq!(Setting::parse(Form::Text, section.data), Ok(setting));
        assert_eq!(setting.counts(), counts);
    }
}

#[test]
fn an_order_follows_the_four_values() {
    let order = Order { control: Control::Follow, ask: true };
    let setting = Setting { kp: 2.5, ki: 0.0, kd: 1.0, set_point: -7.0, order: Some(order) };
    assert_eq!(setting.emit(Form::Text).as_deref(), Ok(&b"32.510112-716"[..]));
    let binary = hex("40 20 00 00  00 00 00 00  3F 80 00 00  C0 E0 00 00  36");
    assert_eq!(setting.emit(Form::Binary).as_deref(), Ok(&binary[..]));
    for form in [Form::Text, Form::Binary] {
        let data = setting.emit(form).expect("it fits");
        assert_eq!(Setting::parse(form, &data), Ok(setting));
        assert_eq!(Setting::parse(form, &[&data[..], &[0; 9]].concat()), Ok(setting), "filled");
        let mut wrong = data.to_vec();
        for digit in [b'8', b'/', 6, 0xFF] {
            *wrong.last_mut().expect("a digit") = digit;
            assert_eq!(Setting::parse(form, &wrong), Err(DataError::Surplus), "{digit}");
        }
    }
    assert_eq!(Setting::parse(Form::Text, b"101010102"), Err(DataError::Surplus), "a length, and no digit");
    assert_eq!(Setting::parse(Form::Text, b"10101010226"), Err(DataError::Surplus), "two digits");
}

#[test]
fn gains_that_text_cannot_say_are_told_apart() {
    let gains = |kp| Gains::new(kp, 0.0, 0.0).expect("gains");
    assert_eq!(setting::check(Form::Text, gains(1e-9)), Err(DataError::Precision { value: 0 }));
    assert_eq!(setting::check(Form::Binary, gains(1e-9)), Ok(()));
    assert_eq!(setting::check(Form::Text, gains(0.012_5)), Ok(()));
}

#[test]
fn settings_have_two_forms() {
    let setting = Setting { kp: 2.5, ki: 0.0, kd: -0.125, set_point: 1_000_000.0, order: None };
    assert_eq!(setting.emit(Form::Text).as_deref(), Ok(&b"32.5106-0.12571000000"[..]));
    let binary = hex("40 20 00 00  00 00 00 00  BE 00 00 00  49 74 24 00");
    assert_eq!(setting.emit(Form::Binary).as_deref(), Ok(&binary[..]));
    for form in [Form::Text, Form::Binary] {
        let data = setting.emit(form).expect("it fits");
        assert_eq!(Setting::parse(form, &data), Ok(setting));
        assert_eq!(Setting::parse(form, &[&data[..], &[0; 30]].concat()), Ok(setting), "filled");
        assert_eq!(Setting::parse(form, &[&data[..], &[0, 1]].concat()), Err(DataError::Surplus));
        assert_eq!(Setting::parse(form, &[&data[..], &[1]].concat()), Err(DataError::Surplus));
        for cut in 0..data.len() {
            assert_eq!(Setting::parse(form, &data[..cut]), Err(DataError::TooShort), "{cut}");
        }
    }
}

#[test]
fn values_that_would_move_an_axis_wrongly_are_refused() {
    let text = |data: &[u8]| Setting::parse(Form::Text, data);
    for (data, error) in [
        (&b"011"[..], DataError::Length { value: 0, received: b'0' }),
        (&b":1234567890"[..], DataError::Length { value: 0, received: b':' }),
        (&b"113nan"[..], DataError::Number { value: 1 }),
        (&b"11113inf"[..], DataError::Number { value: 2 }),
        (&b"11111141e99"[..], DataError::Number { value: 3 }),
        (&b"31,5"[..], DataError::Number { value: 0 }),
        (&b"2 1"[..], DataError::Number { value: 0 }),
    ] {
        assert_eq!(text(data), Err(error), "{}", String::from_utf8_lossy(data));
    }
    assert_eq!(text(b"52.5e11111").map(|setting| setting.kp), Err(DataError::TooShort));
    assert_eq!(text(b"52.5e1111111").map(|setting| setting.kp), Ok(25.0));
    let nan = hex("7F C0 00 00  00 00 00 00  00 00 00 00  00 00 00 00");
    assert_eq!(Setting::parse(Form::Binary, &nan), Err(DataError::Number { value: 0 }));
    let with = |kp| Setting { kp, ..Setting::default() };
    assert_eq!(with(f32::INFINITY).emit(Form::Binary), Err(DataError::Number { value: 0 }));
    // A gain that nine characters would turn into another, or into none.
    for kp in [1.23e-7, 1e-9, 1e10, -1e9] {
        assert_eq!(with(kp).emit(Form::Text), Err(DataError::Precision { value: 0 }), "{kp}");
    }
    for kp in [1.234_567_9, -1.234_567_9, 0.000_123_456_78, 16_777_215.0, -12_345_678.0, 99_999.99] {
        let data = with(kp).emit(Form::Text).expect("it fits");
        let read = text(&data).expect("a setting").kp;
        assert!((read - kp).abs() <= kp.abs() * 1e-3, "{kp} became {read}");
    }
}

proptest! {
    #[test]
    fn settings_read_as_they_were_written(
        values in prop::array::uniform4(-1e6_f32..1e6),
        order in prop::option::of((b'0'..=b'7').prop_map(|digit| Order::from_digit(digit).expect("a digit"))),
    ) {
        let [kp, ki, kd, set_point] = values;
        let setting = Setting { kp, ki, kd, set_point, order };
        let binary = setting.emit(Form::Binary).expect("finite");
        prop_assert_eq!(Setting::parse(Form::Binary, &binary), Ok(setting));
        if let Ok(text) = setting.emit(Form::Text) {
            let read = Setting::parse(Form::Text, &text).expect("a setting");
            prop_assert_eq!(read.order, order);
            for (read, value) in [(read.kp, kp), (read.ki, ki), (read.kd, kd), (read.set_point, set_point)] {
                prop_assert!((read - value).abs() <= value.abs() * 1e-3);
            }
        }
    }

    /// All of the range, to the last count.
    #[test]
    fn set_points_are_exact(count in -MAX_SET_POINT..=MAX_SET_POINT) {
        let setting = Setting { set_point: count as f32, ..Setting::default() };
        for form in [Form::Text, Form::Binary] {
            let data = setting.emit(form).expect("it fits");
            prop_assert_eq!(Setting::parse(form, &data).map(|read| read.counts()), Ok(Some(count)));
        }
    }

    #[test]
    fn counts_are_the_nearest(set_point in -2e7_f32..2e7) {
        match (Setting { set_point, ..Setting::default() }).counts() {
            Some(counts) => prop_assert!((f64::from(counts) - f64::from(set_point)).abs() <= 0.5),
            None => prop_assert!(set_point.abs() > MAX_SET_POINT as f32),
        }
    }

    #[test]
    fn reading_never_panics(bytes in vec(prop_oneof![b'0'..=b'9', any::<u8>()], 0..80)) {
        let _ = Setting::parse(Form::Text, &bytes).map(|setting| setting.counts());
        let _ = Setting::parse(Form::Binary, &bytes).map(|setting| setting.counts());
        if let Some(report) = Report::parse(&bytes) {
            prop_assert_eq!(&report.emit()[..11], &bytes[..11], "the command may be off by one");
        }
    }
}
