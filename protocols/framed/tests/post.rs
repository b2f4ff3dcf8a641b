//! Frames outside of any window: posted, heard, changed, taken back.

mod common;

use std::time::Duration;

use common::{body, emit, line};
use puente_framed::arbiter::Precedence;
use puente_framed::frame::{self, EmitError, FrameError};
use puente_framed::station::{Action, Config, PostError};
use puente_framed::{Class, Kind, Number, Session, Station};
use puente_line::Instant;

type Own = Station<2, 2, 4, 32, 128>;

const SINGLE: Kind = Kind::Single(Class::Data);

/// A station, its clock, and a line that gives back what it says.
struct Rig {
    station: Own,
    now: Instant,
    heard: Vec<Vec<u8>>,
    posted: usize,
    /// What it has sent.
    sent: Vec<Vec<u8>>,
}

impl Rig {
    fn new(promiscuous: bool) -> Self {
        let now = Instant::from_millis(1_000);
        let config = Config { promiscuous, ..Config::new(1, line(), 128) };
        let station = Own::new(config, now, 1);
        Self { station, now: now + Duration::from_millis(1), heard: Vec::new(), posted: 0, sent: Vec::new() }
    }

    /// Does what the station wants for so long, and says what it says.
    fn run(&mut self, ms: u64) {
        let end = self.now + Duration::from_millis(ms);
        while self.now <= end {
            match self.station.poll(self.now) {
                Action::Transmit(bytes) => {
                    let bytes = bytes.to_vec();
                    self.hear(&bytes);
                    self.sent.push(bytes);
                }
                Action::Idle => match self.station.poll_at() {
                    Some(at) if at <= end => self.now = at,
                    _ => break,
                },
                action => {
                    let what = action_of(&action);
                    self.note(what);
                }
            }
        }
        self.now = end;
    }

    fn note(&mut self, what: What) {
        match what {
            What::Heard => self.heard.push(self.station.heard().to_vec()),
            What::Posted => self.posted += 1,
            What::Nothing => {}
        }
    }

    /// The line says these bytes.
    fn hear(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.now += Duration::from_micros(10);
            self.station.receive(self.now, *byte);
            loop {
                match self.station.poll(self.now) {
                    Action::Idle => break,
                    action => {
                        let what = action_of(&action);
                        self.note(what);
                    }
                }
            }
        }
    }
}

enum What {
    Heard,
    Posted,
    Nothing,
}

fn action_of(action: &Action<'_>) -> What {
    match action {
        Action::Heard(_) => What::Heard,
        Action::Posted(outcome) => {
            assert_eq!(*outcome, Ok(()));
            What::Posted
        }
        Action::Free | Action::Received { .. } | Action::Done { .. } => What::Nothing,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_whole_frame_goes_in_its_own_name_or_in_the_stations() {
    let sections = body(&[(17, b"whoever"), (18, b"they are")]);
    for kind in [SINGLE, Kind::Receipt { lrc: 7 }, Kind::Plain] {
        let mut rig = Rig::new(true);
        for origin in [0, 1, 200] {
            let frame = emit(origin, kind, &sections);
            assert_eq!(rig.station.post_frame(rig.now, &frame), Ok(()));
            assert_eq!(rig.station.post_frame(rig.now, &frame), Err(PostError::Busy));
            rig.run(5);
            // Its checks hold in the new name too.
            let own =
                emit(if origin == 0 { 1 } else { origin }, kind, frame::parse(&frame).expect("a frame").body);
            assert_eq!(rig.sent.pop(), Some(own));
        }
        assert_eq!((rig.posted, rig.heard.len()), (3, 0), "none of them is heard as another's");
    }
}

#[test]
fn what_cannot_be_posted_is_said() {
    let mut rig = Rig::new(false);
    let good = emit(1, SINGLE, &body(&[(17, b"good")]));
    assert_eq!(
        rig.station.post_frame(rig.now, &good[1..]),
        Err(PostError::NoFrame(FrameError::Preamble { received: 1 }))
    );
    let long = emit(1, SINGLE, &body(&[(17, &[0; 120])]));
    let too_long = Err(PostError::Unmade(EmitError::TooLong));
    assert_eq!(rig.station.post_frame(rig.now, &long), too_long);
    assert_eq!(rig.station.post(rig.now, SINGLE, &body(&[(17, &[0; 120])])), too_long);
    assert_eq!(
        rig.station.post(rig.now, SINGLE, b"no sections"),
        Err(PostError::Unmade(EmitError::Sections))
    );
    assert!(rig.station.is_free());
    rig.run(5);
    assert!(rig.sent.is_empty());
    assert_eq!(rig.station.post_frame(rig.now, &good), Ok(()));
}

#[test]
fn what_waits_can_be_changed_or_taken_back() {
    let mut rig = Rig::new(false);
    rig.hear(&[0x55]);
    let write = |data: &'static [u8]| {
        move |buffer: &mut heapless::Vec<u8, 128>| Ok(puente_framed::section::push(buffer, 17, data)?)
    };
    assert!(!rig.station.repost(rig.now, SINGLE, write(b"first")) && !rig.station.withdraw());
    assert_eq!(rig.station.post(rig.now, SINGLE, &body(&[(17, b"zeroth")])), Ok(()));
    assert!(rig.station.repost(rig.now, SINGLE, write(b"first")));
    rig.run(5);
    assert_eq!(rig.sent, [emit(1, SINGLE, &body(&[(17, b"first")]))]);
    rig.station.post(rig.now, SINGLE, &body(&[(17, b"second")])).expect("free");
    assert!(rig.station.withdraw());
    rig.run(5);
    assert_eq!((rig.sent.len(), rig.posted), (1, 1));
}

#[test]
fn windows_of_others_are_heard_if_asked_for() {
    let session = Session { sender: 5, receiver: 6 };
    let frames = [
        emit(2, Kind::Opening { sender: 5 }, &body(&[(3, b"")])),
        emit(2, Kind::Numbered { number: Number::ZERO, class: Class::Event, session }, &body(&[(3, b"x")])),
        emit(3, Kind::Acknowledgement { next: 1, held: 0, session }, &body(&[(2, b"")])),
    ];
    for promiscuous in [false, true] {
        let mut rig = Rig::new(promiscuous);
        for frame in &frames {
            rig.hear(frame);
            rig.run(1);
        }
        assert_eq!(rig.heard, if promiscuous { &frames[..] } else { &[] });
        assert!(rig.sent.is_empty(), "none is for this station");
    }
}

/// An answer does not wait for a frame of a window that waits itself; nor is that one lost.
#[test]
fn a_frame_of_a_window_steps_back_for_an_answer() {
    let mut rig = Rig::new(false);
    rig.station.submit(rig.now, 9, Class::Event, &body(&[(9, b"later")])).expect("room");
    // It gets as far as the arbiter, and asks for a consent there.
    rig.hear(&[0x55]);
    assert_eq!(rig.station.poll(rig.now), Action::Idle);
    assert!(!rig.station.is_free() && rig.station.can_answer());
    let receipt = Kind::Receipt { lrc: 1 };
    let write = |buffer: &mut heapless::Vec<u8, 128>| Ok(puente_framed::section::push(buffer, 17, b"")?);
    assert_eq!(rig.station.post_with(rig.now, Precedence::Ordinary, SINGLE, write), Err(PostError::Busy));
    assert_eq!(rig.station.post_with(rig.now, Precedence::Answer, receipt, write), Ok(()));
    assert!(!rig.station.can_answer(), "an answer steps back for nothing");
    rig.run(2);
    let kinds: Vec<_> =
        rig.sent.iter().filter_map(|bytes| frame::parse(bytes).ok()).map(|frame| frame.kind).collect();
    assert!(matches!(kinds[..], [Kind::Receipt { lrc: 1 }, Kind::Opening { .. }]), "{kinds:?}");
}
