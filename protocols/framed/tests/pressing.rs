//! A station that is polled only where it is pressing hears what one hears that is polled after each byte.

use proptest::collection::vec;
use proptest::prelude::*;
use puente_framed::station::{Action, Config};
use puente_framed::{Class, Kind, Station, frame, section};
use puente_line::{Duration, Instant, Settings};

type Listener = Station<2, 2, 4, 64, 256>;

fn listener() -> Listener {
    let line = Settings { baud: 1_000_000, format: "8N1".parse().expect("a format") };
    Listener::new(Config::new(17, line, 256), Instant::ZERO, 1)
}

/// Polls until the station is idle, and notes what it hears.
fn poll(station: &mut Listener, now: Instant, heard: &mut Vec<Vec<u8>>) {
    loop {
        match station.poll(now) {
            Action::Heard(frame) => heard.push([&[frame.origin], frame.body].concat()),
            Action::Idle => return,
            _ => {}
        }
    }
}

fn frame(origin: u8, data: &[u8]) -> Vec<u8> {
    let mut bytes = heapless::Vec::<u8, 256>::new();
    let body = [&[17, data.len() as u8], data, &[section::TERMINATOR]].concat();
    frame::emit(&mut bytes, origin, Kind::Single(Class::Data), &body).expect("a frame");
    bytes.to_vec()
}

/// Frames, and what may be between them.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        3 => (2..=20_u8, vec(any::<u8>(), 0..40)).prop_map(|(origin, data)| frame(origin, &data)),
        1 => vec(prop_oneof![Just(0x7E), any::<u8>()], 0..30),
    ]
}

/// What each of the two hears of these bytes.
fn hear(bytes: &[u8]) -> [Vec<Vec<u8>>; 2] {
    let (mut each, mut pressed) = (listener(), listener());
    let (mut all, mut some) = (Vec::new(), Vec::new());
    let mut now = Instant::ZERO + Duration::from_millis(1);
    for &byte in bytes {
        now += Duration::from_micros(10);
        each.receive(now, byte);
        poll(&mut each, now, &mut all);
        pressed.receive(now, byte);
        if pressed.is_pressing() {
            poll(&mut pressed, now, &mut some);
        }
    }
    // The silence at the end lets both search what is left.
    now += Duration::from_millis(1);
    poll(&mut each, now, &mut all);
    poll(&mut pressed, now, &mut some);
    [all, some]
}

/// More of them than a station keeps.
#[test]
fn frames_in_a_row_are_all_heard() {
    let [all, some] = hear(&frame(2, &[1; 30]).repeat(12));
    assert_eq!((all.len(), some.len()), (12, 12));
}

proptest! {
    #[test]
    fn nothing_is_missed_between_two_polls(pieces in vec(piece(), 1..24)) {
        let [all, some] = hear(&pieces.concat());
        prop_assert_eq!(all, some);
    }
}
