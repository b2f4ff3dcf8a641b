//! A frame of the thesis on a line with a master and three modules.

mod common;

use common::fast;
use puente_framed::frame::{self, MAX_FRAME, TAGGED_OVERHEAD};
use puente_framed::station::{Action, Config};
use puente_framed::{Kind, Station, section};
use puente_line::Instant;
use puente_modules::{Form, Setting};
use puente_shared_line::station::{Application, Framed};
use puente_shared_line::{Line, Place};

/// 3 axes of 255 bytes, built by hand.
const FRAME: &str = include_str!("../../../protocols/framed/tests/thesis.hex");

fn bytes() -> Vec<u8> {
    let code = FRAME.lines().map(|line| line.split('#').next().unwrap_or_default());
    let bytes = code.flat_map(str::split_whitespace);
    bytes.map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect()
}

/// The master sends the frame; a module takes its section and answers.
struct Side {
    address: u8,
    to_send: Option<Vec<u8>>,
    to_answer: Option<(u8, u8)>,
    taken: Option<Setting>,
    answers: Vec<(u8, Kind)>,
    posted: usize,
}

const BODY: usize = MAX_FRAME - TAGGED_OVERHEAD;

impl Application<1, 1, BODY, MAX_FRAME> for Side {
    fn take(&mut self, _now: Instant, action: Action<'_>) {
        match action {
            Action::Heard(heard) if heard.kind == Kind::Plain => {
                if let Some(section) = heard.section_for(self.address) {
                    self.taken = Setting::parse(Form::Text, section.data).ok();
                    self.to_answer = Some((heard.origin, frame::lrc(heard.body)));
                }
            }
            Action::Heard(heard) if heard.destination() == self.address => {
                self.answers.push((heard.origin, heard.kind));
            }
            Action::Heard(_) => {}
            Action::Posted(outcome) => {
                outcome.expect("on the line");
                self.posted += 1;
            }
            other => panic!("{other:?}"),
        }
    }

    fn drive(&mut self, now: Instant, station: &mut Station<1, 1, BODY, MAX_FRAME>) {
        if let Some(bytes) = self.to_send.take() {
            station.post_frame(now, &bytes).expect("a frame");
        }
        if let Some((to, lrc)) = self.to_answer.take() {
            let mut body = heapless::Vec::<u8, 8>::new();
            section::push(&mut body, to, &[]).expect("room");
            station.post(now, Kind::Receipt { lrc }, &body).expect("nothing waits");
        }
    }
}

/// Acceptance: the frame decodes, and is answered by each module.
#[test]
fn a_frame_of_the_thesis_is_answered() {
    let config = |address| Config::new(address, fast(), MAX_FRAME);
    let mut line: Line<Framed<Side, 1, 1, BODY, MAX_FRAME>> =
        Line::new(fast(), config(1).arbiter.gap, 0.0, 1);
    for address in [1, 17, 18, 19, 20] {
        let side = Side {
            address,
            to_send: (address == 1).then(bytes),
            to_answer: None,
            taken: None,
            answers: Vec::new(),
            posted: 0,
        };
        let station = Station::new(config(address), Instant::ZERO, address.into());
        line.join(Framed { application: side, station }, Place::new(fast()));
    }
    line.run_until(Instant::from_millis(20)).expect("manners");
    let side = |station: usize| &line.node(station).application;
    let lrc = bytes()[bytes().len() - 2];
    let mut answers = side(0).answers.clone();
    answers.sort_by_key(|(from, _)| *from);
    assert_eq!(answers, [17, 18, 19].map(|from| (from, Kind::Receipt { lrc })));
    assert_eq!(
        side(1).taken,
        Some(Setting { kp: 2.5, ki: 0.05, kd: 0.001, set_point: 12_000.0, order: None })
    );
    assert_eq!(side(2).taken, Some(Setting { kp: 1.75, ki: 0.1, kd: 0.0, set_point: -340.5, order: None }));
    assert_eq!(
        side(3).taken,
        Some(Setting { kp: 10.0, ki: 2.0, kd: 0.25, set_point: 99_999_999.0, order: None })
    );
    assert_eq!((side(4).taken, side(4).posted), (None, 0), "it was not for this one");
    // All three answer at the same time, and sort it out.
    assert!(line.nodes().map(|node| node.station.statistics().collisions).sum::<u32>() > 0);
}
