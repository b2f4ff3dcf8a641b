//! Frames built by hand, byte by byte.

mod common;

use common::{body, emit, hex};
use puente_framed::frame::{self, FrameError};
use puente_framed::pid::{DataError, Form, Setting};
use puente_framed::{Class, Decoder, Kind, Number, Session};

/// 3 axes of 255 bytes.
const THESIS: &str = include_str!("thesis.hex");

const SESSION: Session = Session { sender: 0x1234, receiver: 0x5678 };

#[test]
fn a_frame_of_the_thesis_is_understood() {
    let bytes = hex(THESIS);
    assert_eq!(bytes.len(), 765 + 6);
    let frame = frame::parse(&bytes).expect("a frame");
    assert_eq!((frame.origin, frame.kind), (1, Kind::Plain));
    let settings = [
        (17, Setting { kp: 2.5, ki: 0.05, kd: 0.001, set_point: 12_000.0 }),
        (18, Setting { kp: 1.75, ki: 0.1, kd: 0.0, set_point: -340.5 }),
        (19, Setting { kp: 10.0, ki: 2.0, kd: 0.25, set_point: 99_999_999.0 }),
    ];
    assert_eq!(frame.sections().count(), 3);
    for (address, setting) in settings {
        let section = frame.section_for(address).expect("a section");
        assert_eq!(section.data.len(), 252);
        assert_eq!(Setting::parse(Form::Text, section.data), Ok(setting));
    }
    assert_eq!(frame.section_for(20), None);
    assert_eq!(emit(1, Kind::Plain, frame.body), bytes);
}

#[test]
fn a_frame_of_the_thesis_is_found_among_noise() {
    let bytes = hex(THESIS);
    let mut decoder = Decoder::<1536>::new();
    let mut found = 0;
    for part in [&[0x7E, 0x0A, 0x55, 0x7E, 0x01, 0x02][..], &bytes, &bytes[..100], &bytes, &[]] {
        for byte in part {
            decoder.push(*byte);
            while decoder.advance() {
                assert_eq!(decoder.frame_bytes(), bytes);
                found += 1;
            }
        }
    }
    decoder.silence();
    while decoder.advance() {
        assert_eq!(decoder.frame_bytes(), bytes);
        found += 1;
    }
    assert_eq!(found, 2);
}

/// LRC and CRC were computed by a program of its own.
#[test]
fn tagged_frames_have_these_bytes() {
    let kind = Kind::Acknowledgement { next: 5, held: 6, session: SESSION };
    let bytes = hex("7E 11 08 10  01 00 0D  FF 0A 05 06 12 34 56 78 A8 18 94 A8 0D  C1 0A");
    assert_eq!(emit(17, kind, &body(&[(1, &[])])), bytes);
    assert_eq!(
        frame::parse(&bytes).map(|frame| (frame.origin, frame.kind, frame.destination())),
        Ok((17, kind, 1))
    );

    let kind = Kind::Numbered { number: Number::new(9), class: Class::Data, session: SESSION };
    let bytes = hex("7E 01 C8 14  11 04 73 74 6F 70 0D  FF 0A 05 00 12 34 56 78 C4 E0 8D 49 0D  6F 0A");
    assert_eq!(emit(1, kind, &body(&[(17, b"stop")])), bytes);
    let frame = frame::parse(&bytes).expect("a frame");
    assert_eq!((frame.kind, frame.section_for(17).map(|section| section.data)), (kind, Some(&b"stop"[..])));
}

#[test]
fn a_short_packet_of_the_thesis_is_filled() {
    for length in 0..60 {
        let body = body(&[(17, &vec![0x31; length])]);
        let bytes = emit(1, Kind::Plain, &body);
        let expected = match body.len() {
            short @ ..=42 => 45.max(short),
            // A section has three bytes at least.
            43 => 46,
            44 => 47,
            long => long,
        };
        assert_eq!(bytes.len(), expected + 6, "{length}");
        let frame = frame::parse(&bytes).expect("a frame");
        assert_eq!(frame.section_for(17).map(|section| section.data.len()), Some(length));
        assert!(frame.sections().skip(1).all(|section| section.address == 0));
    }
}

/// Each with the bytes around it in order, so that nothing else is wrong.
#[test]
fn what_is_wrong_is_said() {
    let good = emit(1, Kind::Plain, &body(&[(17, &[1; 60])]));
    let with = |at: usize, byte: u8| {
        let mut bytes = good.clone();
        bytes[at] = byte;
        frame::parse(&bytes).err()
    };
    let last = good.len() - 1;
    assert_eq!(with(0, 0x7F), Some(FrameError::Preamble { received: 0x7F }));
    assert_eq!(with(2, 8 << 3), Some(FrameError::Tag { received: 8 }));
    assert_eq!(with(3, 44), Some(FrameError::Length { received: 44 }));
    assert_eq!(with(3, 64), Some(FrameError::Size));
    assert_eq!(with(2, 0x10), Some(FrameError::Trailer), "a tag, but no trailer");
    assert_eq!(with(last, 0x0D), Some(FrameError::Terminator { received: 0x0D }));
    assert!(matches!(with(7, 2), Some(FrameError::Lrc { .. })));
    assert_eq!(frame::parse(&good[..last]), Err(FrameError::Size));
    assert_eq!(frame::parse(&[]), Err(FrameError::Size));
    // Section lengths that do not add up, with an LRC that holds.
    let mut bytes = good.clone();
    bytes[5] += 1;
    bytes[last - 1] = bytes[last - 1].wrapping_sub(1);
    assert_eq!(frame::parse(&bytes), Err(FrameError::Sections));
}

/// The LRC does not cover the tag: without the trailer that it leaves behind, a frame of a window whose tag has become 0
/// would be taken for one of the thesis.
#[test]
fn a_tag_that_is_lost_is_noticed() {
    for number in 0..4_096 {
        let kind = Kind::Numbered { number: Number::new(number), class: Class::Data, session: SESSION };
        let mut bytes = emit(1, kind, &body(&[(17, &[1; 60])]));
        bytes[2] &= 0x07;
        assert_eq!(frame::parse(&bytes), Err(FrameError::Trailer));
    }
}

#[test]
fn settings_have_two_forms() {
    let setting = Setting { kp: 2.5, ki: 0.0, kd: -0.125, set_point: 1_000_000.0 };
    assert_eq!(setting.emit(Form::Text).as_deref(), Ok(&b"32.5106-0.12571000000"[..]));
    let binary = hex("40 20 00 00  00 00 00 00  BE 00 00 00  49 74 24 00");
    assert_eq!(setting.emit(Form::Binary).as_deref(), Ok(&binary[..]));
    for form in [Form::Text, Form::Binary] {
        let data = setting.emit(form).expect("it fits");
        assert_eq!(Setting::parse(form, &data), Ok(setting));
        assert_eq!(Setting::parse(form, &[&data[..], &[0; 30]].concat()), Ok(setting), "filled");
        assert_eq!(Setting::parse(form, &[&data[..], &[0, 1]].concat()), Err(DataError::Surplus));
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
