//! Requests and messages as texts: published ones, round trips, and anything at all.

use proptest::prelude::*;
use puente_canopen::{Frame, Id};
use puente_socketcand::{BadMessage, BadRequest, MAX_TEXT, Message, Request, Texts};

fn base(id: u16, data: &[u8]) -> Frame {
    Frame::new(Id::base(id), data).expect("a frame")
}

/// A text without its brackets.
fn inside(text: &str) -> &[u8] {
    text.strip_prefix('<').and_then(|text| text.strip_suffix('>')).expect("brackets").as_bytes()
}

/// As the README of socketcand has them.
#[test]
fn requests_are_those_of_the_readme() {
    let extended = Frame::new(Id::extended(0x12345678), &[]).expect("a frame");
    for (text, request) in [
        ("< open can0 >", Request::Open("can0")),
        ("< rawmode >", Request::RawMode),
        ("< bcmmode >", Request::BcmMode),
        ("< send 123 0 >", Request::Send(base(0x123, &[]))),
        (
            "< send 1AA 8 11 22 33 44 55 66 77 88 >",
            Request::Send(base(0x1AA, &[17, 34, 51, 68, 85, 102, 119, 136])),
        ),
        ("< send 12345678 0 >", Request::Send(extended)),
        ("< subscribe 0 0 123 >", Request::Subscribe { id: Id::base(0x123), micros: 0 }),
        (
            "< subscribe 1 500000 00000123 >",
            Request::Subscribe { id: Id::extended(0x123), micros: 1_500_000 },
        ),
        ("< unsubscribe 123 >", Request::Unsubscribe(Id::base(0x123))),
        ("< echo >", Request::Echo),
        ("< statistics 1000 >", Request::Statistics(1000)),
    ] {
        assert_eq!(Request::parse(inside(text)), Ok(request), "{text}");
        assert_eq!(request.emit().as_deref(), Some(text));
    }
    for text in [
        "< add 1 0 123 8 11 22 33 44 55 66 77 88 >",
        "< update 123 8 11 22 33 44 55 66 77 88 >",
        "< delete 123 >",
        "< filter 0 0 123 1 FF >",
        "< muxfilter 0 0 123 2 FF 00 00 00 00 00 00 00 >",
        "< controlmode >",
        "< isotpmode >",
        "< isotpconf 712 7D0 25 8 2 >",
        "< sendpdu 00112233 >",
    ] {
        assert_eq!(Request::parse(inside(text)), Ok(Request::Unsupported), "{text}");
    }
}

/// python-can sends bytes as they are in hexadecimal, without leading zeros and in lower case (socketcand.py).
#[test]
fn requests_of_python_can_are_understood() {
    assert_eq!(
        Request::parse(b" send 602 8 40 0 10 0 0 0 0 ff "),
        Ok(Request::Send(base(0x602, &[0x40, 0, 0x10, 0, 0, 0, 0, 0xFF])))
    );
    assert_eq!(Request::parse(b" send 7 1 5 "), Ok(Request::Send(base(7, &[5]))));
}

#[test]
fn messages_are_those_of_the_readme() {
    for (text, message) in [
        ("< hi >", Message::Hi),
        ("< ok >", Message::Ok),
        ("< echo >", Message::Echo),
        ("< error could not open bus >", Message::NO_BUS),
        ("< error unknown command >", Message::UNKNOWN),
        (
            "< frame 123 23.424242 11223344 >",
            Message::Frame { frame: base(0x123, &[0x11, 0x22, 0x33, 0x44]), micros: 23_424_242 },
        ),
        ("< frame 123 0.000001  >", Message::Frame { frame: base(0x123, &[]), micros: 1 }),
        ("< error 004 1.000000 >", Message::BusError { class: 4, micros: 1_000_000 }),
        ("< stat 1 2 3 4 >", Message::Statistics { received_bytes: 1, received: 2, sent_bytes: 3, sent: 4 }),
    ] {
        assert_eq!(Message::parse(inside(text)), Ok(message), "{text}");
        assert_eq!(message.emit().as_deref(), Some(text));
    }
    let extended = Frame::new(Id::extended(0x123), &[0xAB]).expect("a frame");
    assert_eq!(
        Message::Frame { frame: extended, micros: 1_700_000_000_123_456 }.emit().as_deref(),
        Some("< frame 00000123 1700000000.123456 AB >")
    );
}

#[test]
fn what_is_none_is_refused() {
    for text in [
        "",
        " ",
        "hello",
        "open",
        "open can0 can1",
        "open a-name-of-more-than-16",
        "send",
        "send 123",
        "send 123 9 1 2 3 4 5 6 7 8 9",
        "send 123 2 11",
        "send 123 1 11 22",
        "send 800 0",
        "send 20000000 0",
        "send 123456789 0",
        "send 123 1 100",
        "send 12G 0",
        "send -1 0",
        "rawmode now",
        "statistics",
        "subscribe 0 0",
        "subscribe 0 99999999999 1",
    ] {
        assert_eq!(Request::parse(text.as_bytes()), Err(BadRequest), "{text}");
    }
    for text in [
        "",
        "frame",
        "frame 123",
        "frame 123 1.5 11",
        "frame 123 1.000000 1",
        "frame 123 1.000000 112233445566778899",
        "stat 1 2",
    ] {
        assert_eq!(Message::parse(text.as_bytes()), Err(BadMessage), "{text}");
    }
}

/// The protocol has no remote frames.
#[test]
fn remote_frames_cannot_be_said() {
    let frame = Frame::remote(Id::base(0x701), 1);
    assert_eq!(Request::Send(frame).emit(), None);
    assert_eq!(Message::Frame { frame, micros: 0 }.emit(), None);
}

#[test]
fn texts_fit() {
    let frame = Frame::new(Id::extended(u32::MAX), &[0xFF; 8]).expect("a frame");
    let micros = u64::from(u32::MAX) * 1_000_000 + 999_999;
    for text in [Request::Send(frame).emit(), Message::Frame { frame, micros }.emit()] {
        let text = text.expect("a text");
        assert!(text.len() - 2 <= MAX_TEXT);
    }
    let why = "x".repeat(MAX_TEXT);
    assert_eq!(Message::Error(&why).emit(), None);
    assert_eq!(Request::Open("").emit(), None);
    assert_eq!(Request::Open("a>").emit(), None);
}

fn frames() -> impl Strategy<Value = Frame> {
    let id = (any::<bool>(), any::<u32>());
    (id, proptest::collection::vec(any::<u8>(), 0..9)).prop_map(|((extended, id), data)| {
        let id = if extended { Id::extended(id) } else { Id::base(id as u16) };
        Frame::new(id, &data).expect("a frame")
    })
}

proptest! {
    #[test]
    fn frames_come_back(frames in proptest::collection::vec((frames(), any::<u32>()), 1..10)) {
        let mut texts = Texts::new();
        let mut back = Vec::new();
        for (frame, micros) in &frames {
            let request = Request::Send(*frame).emit().expect("a text");
            let message = Message::Frame { frame: *frame, micros: (*micros).into() }.emit().expect("a text");
            for byte in request.bytes().chain(message.bytes()) {
                let Some(text) = texts.push(byte) else { continue };
                let text = text.expect("no text is too long");
                if let Ok(Request::Send(frame)) = Request::parse(text) {
                    back.push(frame);
                }
                if let Ok(Message::Frame { frame, micros: at }) = Message::parse(text) {
                    prop_assert_eq!(at, u64::from(*micros));
                    back.push(frame);
                }
            }
        }
        prop_assert_eq!(back, frames.iter().flat_map(|(frame, _)| [*frame; 2]).collect::<Vec<_>>());
    }

    /// Whatever is read can be said again, and means the same.
    #[test]
    fn anything_is_read_or_refused(text in "[<> a-z0-9A-F.]{0,200}", bytes: Vec<u8>) {
        let mut texts = Texts::new();
        for byte in text.bytes().chain(bytes) {
            let Some(Some(text)) = texts.push(byte) else { continue };
            if let Ok(request) = Request::parse(text)
                && let Some(said) = request.emit()
            {
                prop_assert_eq!(Request::parse(inside(&said)), Ok(request));
            }
            if let Ok(message) = Message::parse(text)
                && let Some(said) = message.emit()
            {
                prop_assert_eq!(Message::parse(inside(&said)), Ok(message));
            }
        }
    }
}
