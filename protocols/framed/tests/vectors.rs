//! Frames built by hand, byte by byte.

mod common;

use common::{body, emit, hex};
use puente_framed::frame::{self, FrameError};
use puente_framed::{Class, Decoder, Kind, Number, Reason, Session};

/// 3 axes of 255 bytes.
const THESIS: &str = include_str!("thesis.hex");

const SESSION: Session = Session { sender: 0x1234, receiver: 0x5678 };

#[test]
fn a_frame_of_the_thesis_is_understood() {
    let bytes = hex(THESIS);
    assert_eq!(bytes.len(), 765 + 6);
    let frame = frame::parse(&bytes).expect("a frame");
    assert_eq!((frame.origin, frame.kind), (1, Kind::Plain));
    assert_eq!(frame.sections().count(), 3);
    for address in 17..20 {
        assert_eq!(frame.section_for(address).map(|section| section.data.len()), Some(252));
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

/// What a gateway says to its clients has these numbers, whatever is added.
#[test]
fn reasons_have_these_numbers() {
    let reasons = [
        Reason::Session,
        Reason::TooLong,
        Reason::NoRoom,
        Reason::Meaningless,
        Reason::Collisions,
        Reason::NoEcho,
        Reason::NoLine,
        Reason::Denied,
        Reason::Stopped,
        Reason::Lost,
    ];
    for (number, reason) in (1..).zip(reasons) {
        let bytes = emit(1, Kind::Refusal { reason, session: Session::NONE }, &body(&[(17, &[])]));
        // After header, section and the head of the trailer.
        assert_eq!(bytes[9], number, "{reason:?}");
    }
}
