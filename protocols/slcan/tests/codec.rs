//! Commands and replies as texts: published ones, round trips, and anything at all.

use proptest::prelude::*;
use puente_canopen::{Frame, Id};
use puente_slcan::{BadCommand, BadReply, BusState, Command, End, Flags, Lines, MAX_LINE, Rate, Reply};

fn base(id: u16, data: &[u8]) -> Frame {
    Frame::new(Id::base(id), data).expect("a frame")
}

fn extended(id: u32, data: &[u8]) -> Frame {
    Frame::new(Id::extended(id), data).expect("a frame")
}

/// What python-can's tests send and expect (test_slcan.py), and what Lawicel's manual has as examples.
#[test]
fn frames_are_those_of_python_can() {
    for (text, frame) in [
        (&b"t4563112233\r"[..], base(0x456, &[0x11, 0x22, 0x33])),
        (b"T12ABCDEF2AA55\r", extended(0x12AB_CDEF, &[0xAA, 0x55])),
        (b"r1238\r", Frame::remote(Id::base(0x123), 8)),
        (b"R12ABCDEF6\r", Frame::remote(Id::extended(0x12AB_CDEF), 6)),
        (b"t1000\r", base(0x100, &[])),
    ] {
        let (line, end) = text.split_at(text.len() - 1);
        assert_eq!(end, b"\r");
        assert_eq!(Command::parse(line), Ok(Command::Send(frame)));
        assert_eq!(Command::Send(frame).emit(), text);
        assert_eq!(Reply::parse(End::Return, line), Ok(Reply::Heard { frame, stamp: None }));
        assert_eq!(Reply::Heard { frame, stamp: None }.emit(), text);
    }
    // A CANDapter's extended frame, and lower case.
    assert_eq!(Command::parse(b"x12abcdef2aa55"), Ok(Command::Send(extended(0x12AB_CDEF, &[0xAA, 0x55]))));
}

#[test]
fn commands_have_their_letters() {
    for (text, command) in [
        (&b"\r"[..], Command::Nothing),
        (b"S0\r", Command::Rate(Rate::K10)),
        (b"S8\r", Command::Rate(Rate::M1)),
        (b"s031C\r", Command::Timing { btr0: 0x03, btr1: 0x1C }),
        (b"O\r", Command::Open),
        (b"L\r", Command::Listen),
        (b"C\r", Command::Close),
        (b"F\r", Command::Flags),
        (b"V\r", Command::Version),
        (b"N\r", Command::Serial),
        (b"Z0\r", Command::Stamps(false)),
        (b"Z1\r", Command::Stamps(true)),
        (b"M00000000\r", Command::Code(0)),
        (b"mFFFFFFFF\r", Command::Mask(u32::MAX)),
    ] {
        assert_eq!(command.emit(), text);
        assert_eq!(Command::parse(&text[..text.len() - 1]), Ok(command));
    }
}

#[test]
fn replies_have_their_letters() {
    let frame = base(0x100, &[1]);
    for (text, reply) in [
        (&b"\r"[..], Reply::Done),
        (b"z\r", Reply::Taken { extended: false }),
        (b"Z\r", Reply::Taken { extended: true }),
        (b"t1001015D75\r", Reply::Heard { frame, stamp: Some(0x5D75) }),
        (b"F84\r", Reply::Flags(Flags(0x84))),
        (b"V1013\r", Reply::Version { hardware: 0x10, software: 0x13 }),
        (b"NA123\r", Reply::Serial(*b"A123")),
        // Linux' slcan driver has these two.
        (b"sb256256\r", Reply::State { state: BusState::Off, rx_errors: 256, tx_errors: 256 }),
        (b"sa057033\r", Reply::State { state: BusState::Active, rx_errors: 57, tx_errors: 33 }),
    ] {
        assert_eq!(reply.emit(), text);
        assert_eq!(Reply::parse(End::Return, &text[..text.len() - 1]), Ok(reply));
    }
    assert_eq!(Reply::Refused.emit(), b"\x07");
    assert_eq!(Reply::parse(End::Bell, b"t12"), Ok(Reply::Refused));
}

#[test]
fn what_is_none_is_refused() {
    for line in [
        &b"S9"[..],
        b"S",
        b"S66",
        b"s12",
        b"t",
        b"t12",
        b"t123",
        b"t1232AA",
        b"t1231AAB",
        b"t8000",
        b"t12G0",
        b"T200000000",
        b"T1234",
        b"d1230",
        b"b1230",
        b"M0",
        b"Z2",
        b"Q",
        b"OO",
        b"t1231+5",
        b"r1238AAAAA",
        b"t123 1AA",
    ] {
        assert_eq!(Command::parse(line), Err(BadCommand), "{:?}", core::str::from_utf8(line));
    }
    // CANable's answer to V; a serial number that is too long.
    for line in
        [&b"V1.0-g0123abc"[..], b"N12345", b"F8", b"F8G", b"zz", b"?", b"sb25625", b"sc000000", b"sa0F0000"]
    {
        assert_eq!(Reply::parse(End::Return, line), Err(BadReply), "{:?}", core::str::from_utf8(line));
    }
}

/// ISO 11898-1: data length codes above 8 are 8.
#[test]
fn a_length_above_8_is_8() {
    assert_eq!(
        Command::parse(b"t123F0001020304050607"),
        Ok(Command::Send(base(0x123, &[0, 1, 2, 3, 4, 5, 6, 7])))
    );
    assert_eq!(Command::parse(b"r123F"), Ok(Command::Send(Frame::remote(Id::base(0x123), 8))));
}

prop_compose! {
    fn frames()(
        extended: bool,
        remote: bool,
        id: u32,
        length in 0..9u8,
        data: [u8; 8],
    ) -> Frame {
        let id = if extended { Id::extended(id) } else { Id::base(id as u16) };
        if remote { Frame::remote(id, length) } else { Frame::new(id, &data[..length.into()]).expect("a frame") }
    }
}

fn commands() -> impl Strategy<Value = Command> {
    prop_oneof![
        frames().prop_map(Command::Send),
        (b'0'..=b'8').prop_map(|digit| Command::Rate(Rate::of_digit(digit).expect("a rate"))),
        any::<[u8; 2]>().prop_map(|[btr0, btr1]| Command::Timing { btr0, btr1 }),
        any::<u32>().prop_map(Command::Code),
        any::<u32>().prop_map(Command::Mask),
        any::<bool>().prop_map(Command::Stamps),
    ]
}

fn replies() -> impl Strategy<Value = Reply> {
    prop_oneof![
        (frames(), any::<Option<u16>>()).prop_map(|(frame, stamp)| Reply::Heard { frame, stamp }),
        any::<u8>().prop_map(|flags| Reply::Flags(Flags(flags))),
        any::<[u8; 2]>().prop_map(|[hardware, software]| Reply::Version { hardware, software }),
        "[0-9A-Za-z]{4}".prop_map(|text| Reply::Serial(text.into_bytes().try_into().expect("four"))),
        any::<bool>().prop_map(|extended| Reply::Taken { extended }),
        (0..4_usize, 0..1_000_u16, 0..1_000_u16).prop_map(|(state, rx_errors, tx_errors)| {
            let states = [BusState::Active, BusState::Warning, BusState::Passive, BusState::Off];
            Reply::State { state: states[state], rx_errors, tx_errors }
        }),
        Just(Reply::Done),
        Just(Reply::Refused),
    ]
}

proptest! {
    /// Through the bytes of a line, whole.
    #[test]
    fn commands_come_back(commands in proptest::collection::vec(commands(), 1..20)) {
        let mut lines = Lines::new();
        let mut back = Vec::new();
        for byte in commands.iter().flat_map(Command::emit) {
            if let Some((end, line)) = lines.push(byte) {
                prop_assert_eq!(end, End::Return);
                back.push(Command::parse(line.expect("a line")).expect("a command"));
            }
        }
        prop_assert_eq!(back, commands);
    }

    #[test]
    fn replies_come_back(replies in proptest::collection::vec(replies(), 1..20)) {
        let mut lines = Lines::new();
        let mut back = Vec::new();
        for byte in replies.iter().flat_map(Reply::emit) {
            if let Some((end, line)) = lines.push(byte) {
                back.push(Reply::parse(end, line.expect("a line")).expect("a reply"));
            }
        }
        prop_assert_eq!(back, replies);
    }

    /// Whatever is read can be said again, and means the same; no line is longer than it may be.
    #[test]
    fn anything_is_read_or_refused(bytes: Vec<u8>) {
        let mut lines = Lines::new();
        for byte in bytes {
            let Some((end, Some(line))) = lines.push(byte) else { continue };
            prop_assert!(line.len() <= MAX_LINE);
            if let Ok(command) = Command::parse(line) {
                let text = command.emit();
                prop_assert_eq!(Command::parse(&text[..text.len() - 1]), Ok(command));
            }
            if let Ok(reply) = Reply::parse(end, line) {
                let text = reply.emit();
                prop_assert_eq!(text.last(), Some(&if reply == Reply::Refused { 7 } else { b'\r' }));
            }
        }
    }
}
