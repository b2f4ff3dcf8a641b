//! Properties of the codecs.

mod common;

use common::{body, emit};
use proptest::collection::vec;
use proptest::prelude::*;
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Class, Decoder, Kind, Number, Reason, Session};

fn class() -> impl Strategy<Value = Class> {
    prop_oneof![Just(Class::Status), Just(Class::Event), Just(Class::Data)]
}

fn session() -> impl Strategy<Value = Session> {
    (1..=u16::MAX, any::<u16>()).prop_map(|(sender, receiver)| Session { sender, receiver })
}

fn kind() -> impl Strategy<Value = Kind> {
    let number = (0..4_096_u16).prop_map(Number::new);
    const REASONS: &[Reason] = &[
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
    prop_oneof![
        Just(Kind::Plain),
        (number, class(), session()).prop_map(|(number, class, session)| Kind::Numbered {
            number,
            class,
            session
        }),
        class().prop_map(Kind::Single),
        (any::<u8>(), any::<u8>(), session()).prop_map(|(next, held, session)| Kind::Acknowledgement {
            next,
            held,
            session
        }),
        any::<u8>().prop_map(|lrc| Kind::Receipt { lrc }),
        (prop::sample::select(REASONS), prop_oneof![session(), Just(Session::NONE)])
            .prop_map(|(reason, session)| Kind::Refusal { reason, session }),
        (1..=u16::MAX).prop_map(|sender| Kind::Opening { sender }),
        (session(), 1..=8_u8).prop_map(|(session, window)| Kind::Consent { session, window }),
    ]
}

/// Data in which 7E and 0A come up often.
fn data(most: usize) -> impl Strategy<Value = Vec<u8>> {
    vec(prop_oneof![Just(0x7E), Just(0x0A), any::<u8>()], 0..=most)
}

fn sections() -> impl Strategy<Value = Vec<u8>> {
    vec((1..=254_u8, data(255)), 1..=5).prop_map(|sections| {
        let sections: Vec<_> = sections.iter().map(|(address, data)| (*address, &data[..])).collect();
        body(&sections)
    })
}

/// Origin, kind, sections.
fn parts() -> impl Strategy<Value = (u8, Kind, Vec<u8>)> {
    (any::<u8>(), kind(), sections())
}

/// All frames that a decoder finds; the pieces make no difference.
fn decode(bytes: &[u8], pieces: usize, silent: bool) -> Vec<Vec<u8>> {
    let mut decoder = Decoder::<MAX_FRAME>::new();
    let mut found = Vec::new();
    for piece in bytes.chunks(pieces.max(1)) {
        for byte in piece {
            decoder.push(*byte);
            while decoder.is_ready() && decoder.advance() {
                found.push(decoder.frame_bytes().to_vec());
            }
        }
    }
    if silent {
        decoder.silence();
        while decoder.advance() {
            found.push(decoder.frame_bytes().to_vec());
        }
        assert!(!decoder.is_inside());
    }
    found
}

proptest! {
    #[test]
    fn a_frame_says_what_was_put_into_it((origin, kind, body) in parts()) {
        let bytes = emit(origin, kind, &body);
        let frame = frame::parse(&bytes).expect("a frame");
        prop_assert_eq!((frame.origin, frame.kind), (origin, kind));
        match kind {
            Kind::Plain => prop_assert!(frame.body.starts_with(&body)),
            _ => prop_assert_eq!(frame.body, &body[..]),
        }
        prop_assert_eq!(emit(origin, kind, frame.body), bytes);
    }

    #[test]
    fn another_origin_is_all_that_changes((origin, kind, body) in parts(), other: u8, cut in any::<prop::sample::Index>()) {
        let mut bytes = emit(origin, kind, &body);
        prop_assert_eq!(frame::set_origin(&mut bytes, other), Ok(()));
        prop_assert_eq!(&bytes, &emit(other, kind, &body));
        let cut = cut.index(bytes.len());
        let part = bytes[..cut].to_vec();
        prop_assert!(frame::set_origin(&mut bytes[..cut], origin).is_err());
        prop_assert_eq!(&bytes[..cut], part);
    }

    /// What is taken for a frame has no other form.
    #[test]
    fn a_frame_has_one_form((origin, kind, body) in parts(), changes in vec((any::<prop::sample::Index>(), any::<u8>()), 0..4)) {
        let mut bytes = emit(origin, kind, &body);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if let Ok(frame) = frame::parse(&bytes) {
            prop_assert_eq!(emit(frame.origin, frame.kind, frame.body), bytes);
        }
    }

    /// Whatever was changed: up to five bits of a frame of up to 655 bytes, three of a longer one. What the CRC does not
    /// cover has checks of its own: the first byte, the last three.
    #[test]
    fn wrong_bits_of_a_tagged_frame_are_noticed(
        (origin, kind, body) in parts().prop_filter("tagged", |(_, kind, _)| *kind != Kind::Plain),
        wrong in vec(any::<prop::sample::Index>(), 1..=5),
    ) {
        let bytes = emit(origin, kind, &body);
        let most = if bytes.len() <= 655 { 5 } else { 3 };
        let mut damaged = bytes.clone();
        for index in wrong.iter().take(most) {
            let bit = index.index(bytes.len() * 8);
            damaged[bit / 8] ^= 1 << (bit % 8);
        }
        prop_assume!(damaged != bytes);
        if let Ok(frame) = frame::parse(&damaged) {
            prop_assert!(false, "taken as {:?}", frame.kind);
        }
    }

    #[test]
    fn parsing_never_panics(bytes in data(200)) {
        let _ = frame::parse(&bytes);
        let _ = decode(&bytes, 1, true);
    }

    /// Garbage without a 7E delays nothing.
    #[test]
    fn frames_are_found_at_once(
        frames in vec(parts(), 1..4),
        garbage in vec(vec(any::<u8>().prop_filter("no 7E", |byte| *byte != 0x7E), 0..40), 4),
        pieces in 1..2000_usize,
    ) {
        let frames: Vec<_> = frames.iter().map(|(origin, kind, body)| emit(*origin, *kind, body)).collect();
        let mut bytes = Vec::new();
        for (garbage, frame) in garbage.iter().zip(&frames) {
            bytes.extend(garbage);
            bytes.extend(frame);
        }
        prop_assert_eq!(decode(&bytes, pieces, false), frames);
    }

    /// Garbage that looks like the beginning of a frame delays what follows, until the line falls silent.
    #[test]
    fn frames_are_found_after_any_garbage((origin, kind, body) in parts(), garbage in data(100), cut in 0..1530_usize) {
        let frame = emit(origin, kind, &body);
        let begun = &frame[..cut.min(frame.len() - 1)];
        let bytes = [&garbage[..], begun, &frame, &garbage].concat();
        let found = decode(&bytes, 1, true);
        prop_assert!(found.contains(&frame));
    }

    /// A decoder with less room passes over what is too long, whole: frames inside it are data.
    #[test]
    fn long_frames_are_passed_over((origin, kind, body) in parts()) {
        let inner = emit(2, Kind::Plain, &common::body(&[(9, &[1; 60])]));
        let around = common::body(&[(9, &inner), (9, &[7; 255])]);
        let kept = 1500 - around.len();
        prop_assume!(body.len() <= kept);
        let long = emit(origin, kind, &[body, around].concat());
        let short = emit(origin, Kind::Single(Class::Data), &common::body(&[(9, b"after")]));
        let mut decoder = Decoder::<256>::new();
        let mut found = Vec::new();
        for byte in [&long[..], &short].concat() {
            decoder.push(byte);
            while decoder.advance() {
                found.push(decoder.frame_bytes().to_vec());
            }
        }
        prop_assert_eq!(found, [short]);
    }
}

/// Every single bit of a frame of a window.
#[test]
fn no_single_bit_passes() {
    let session = Session { sender: 1, receiver: 2 };
    let kind = Kind::Numbered { number: Number::ZERO, class: Class::Data, session };
    let bytes = emit(1, kind, &body(&[(17, &[0x7E; 40])]));
    for bit in 0..bytes.len() * 8 {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(frame::parse(&damaged).is_err(), "bit {bit}");
    }
}
