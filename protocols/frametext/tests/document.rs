//! The spellings of the document, and whatever else may come.

use proptest::prelude::*;
use puente_canopen::{Frame, Id};
use puente_frametext::{Message, Mistake, Mode, parse};

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(Id::base(id), data).expect("8 bytes at most")
}

#[test]
fn the_document_is_read_as_it_is_printed() {
    let nmt = frame(0, &[0x81, 2]);
    for text in
        ["0, 2, 81 – 02", "0,2,81-02", "000,2,8102", "0x0 , 2 ,81 02", " 0, 2, 81 − 02 ", "0, 02, 81—02"]
    {
        assert_eq!(parse(text.as_bytes()), Ok(nmt), "{text}");
    }
    assert_eq!(parse(b"0, 2, 81 \x96 02"), Ok(nmt));
    assert_eq!(parse(b"282, 3, 000000"), Ok(frame(0x282, &[0; 3])));
    assert_eq!(parse(b"702, 1, 00"), Ok(frame(0x702, &[0])));
    assert_eq!(
        parse("402, 6, 0F – 00 – 30 – 40 – 50 – 00".as_bytes()),
        Ok(frame(0x402, &[0x0F, 0, 0x30, 0x40, 0x50, 0]))
    );
    let request = frame(0x602, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
    assert_eq!(parse(b"602,8,40-41-60-00-00-00-00-00"), Ok(request));
}

#[test]
fn beyond_the_document() {
    assert_eq!(parse(b"80,0"), Ok(frame(0x80, &[])));
    assert_eq!(parse(b"80,0,"), Ok(frame(0x80, &[])));
    assert_eq!(parse(b"702,1,R"), Ok(Frame::remote(Id::base(0x702), 1)));
    assert_eq!(parse(b"18FF0102,1,aa"), Ok(Frame::new(Id::extended(0x18FF_0102), &[0xAA]).expect("a byte")));
    assert_eq!(parse(b"00000123,0"), Ok(Frame::new(Id::extended(0x123), &[]).expect("no byte")));
}

#[test]
fn what_is_no_frame_says_why() {
    for (text, mistake) in [
        ("", Mistake::Parts),
        ("602", Mistake::Parts),
        ("xyz,0", Mistake::Id),
        (",0", Mistake::Id),
        ("20000000,0", Mistake::Id),
        ("602,9,", Mistake::Length),
        ("602,,", Mistake::Length),
        ("602,2,8", Mistake::Data),
        ("602,2,8g-02", Mistake::Data),
        ("602,2,81-02,0", Mistake::Data),
        ("602,2,81", Mistake::Count { said: 2, found: 1 }),
        ("602,8,000000000000000000", Mistake::Count { said: 8, found: 9 }),
    ] {
        assert_eq!(parse(text.as_bytes()), Err(mistake), "{text}");
    }
}

#[test]
fn frames_become_messages() {
    let reply = frame(0x582, &[0x4B, 0x41, 0x60, 0, 0x40, 2, 0, 0]);
    assert_eq!(Message(Mode::Controller, &reply).to_string(), ":582,8,4B-41-60-00-40-02-00-00\r\n");
    assert_eq!(Message(Mode::Bridge, &reply).to_string(), "=582,8,4B-41-60-00-40-02-00-00X\r\n");
    assert_eq!(Message(Mode::Controller, &frame(0x80, &[])).to_string(), ":080,0,\r\n");
}

fn any_frame() -> impl Strategy<Value = Frame> {
    let id = prop_oneof![any::<u16>().prop_map(Id::base), any::<u32>().prop_map(Id::extended)];
    (id, any::<bool>(), proptest::collection::vec(any::<u8>(), 0..=8)).prop_map(|(id, remote, data)| {
        match remote {
            true => Frame::remote(id, data.len() as u8),
            false => Frame::new(id, &data).expect("8 bytes at most"),
        }
    })
}

proptest! {
    #[test]
    fn what_is_written_is_read(frame in any_frame()) {
        for mode in [Mode::Controller, Mode::Bridge] {
            let text = Message(mode, &frame).to_string();
            prop_assert_eq!(Mode::of(text.as_bytes()[0]), Some(mode));
            prop_assert_eq!(parse(text[1..].trim_end_matches(mode.end()).as_bytes()), Ok(frame));
        }
    }

    #[test]
    fn anything_is_taken(text in proptest::collection::vec(any::<u8>(), 0..60), alike in "[0-9A-F,\\- ]{0,40}") {
        for text in [&text[..], alike.as_bytes()] {
            if let Ok(frame) = parse(text) {
                let message = Message(Mode::Bridge, &frame).to_string();
                prop_assert_eq!(parse(message.trim_start_matches('=').trim_end_matches("X\r\n").as_bytes()), Ok(frame));
            }
        }
    }
}
