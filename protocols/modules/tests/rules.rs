//! Who may do what with a module: the node alone, told by whole frames.

use std::time::Duration;

use proptest::prelude::*;
use puente_drives::pid::{Cause, Config, Encoder, EncoderFault, Input, Module, State, Width};
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Class, Kind, section, station};
use puente_line::{Instant, Settings};
use puente_modules::{Control, Form, Node, Order, Refusal, Report, Setting, node};

const GAINS: [f32; 3] = [0.01, 0.0, 0.0];

/// A module at rest at 5000 counts, with a loop of 1 kHz.
struct Rig {
    node: Node<2, 2, MAX_FRAME>,
    module: Module,
    now: Instant,
    encoder: Result<u32, EncoderFault>,
}

impl Rig {
    fn new() -> Self {
        let line = Settings { baud: 1_000_000, format: "8N1".parse().expect("format") };
        let station = station::Config::new(17, line, 64);
        let now = Instant::from_millis(1_000);
        let config = Config { rate: 1_000, ..Config::new(Encoder::Binary(Width::W32)) };
        let mut rig = Self {
            node: Node::new(node::Config { station, form: Form::Text }, now, 1),
            module: Module::new(config).expect("settings"),
            now,
            encoder: Ok(5_000),
        };
        rig.wait(2);
        rig
    }

    /// Lets the loop run.
    fn wait(&mut self, ms: u64) {
        for _ in 0..ms {
            self.now += Duration::from_millis(1);
            let input = Input { encoder: self.encoder, amplifier_fault: false, now: self.now };
            if let Some(event) = self.module.step(input).event {
                self.node.event(event);
            }
        }
    }

    /// The line says these bytes; what the module answers.
    fn hear(&mut self, bytes: &[u8]) -> Vec<Vec<u8>> {
        for byte in bytes {
            self.now += Duration::from_micros(10);
            self.node.receive(self.now, *byte);
            while self.node.poll(self.now, &mut self.module) != node::Action::Idle {}
        }
        let mut answers = Vec::new();
        let end = self.now + Duration::from_micros(500);
        while self.now < end {
            let sent = match self.node.poll(self.now, &mut self.module) {
                node::Action::Transmit(bytes) => bytes.to_vec(),
                _ => {
                    self.now += Duration::from_micros(10);
                    continue;
                }
            };
            for byte in &sent {
                self.now += Duration::from_micros(10);
                self.node.receive(self.now, *byte);
            }
            answers.push(sent);
        }
        answers
    }

    /// One says what a gateway says in a cycle, and what the module reports to that.
    fn say(&mut self, origin: u8, control: Control, gains: [f32; 3], set_point: f32) -> Report {
        let order = Some(Order { control, ask: true });
        let [kp, ki, kd] = gains;
        let data = Setting { kp, ki, kd, set_point, order }.emit(Form::Text).expect("it fits");
        self.say_data(origin, &data)
    }

    fn say_data(&mut self, origin: u8, data: &[u8]) -> Report {
        let mut frame = heapless::Vec::<u8, 128>::new();
        frame::build(&mut frame, origin, Kind::Single(Class::Data), |body| {
            Ok(section::push(body, 17, data)?)
        })
        .expect("a frame");
        let answers = self.hear(&frame);
        let mut reports = answers.iter().filter_map(|bytes| {
            let frame = frame::parse(bytes).expect("a frame");
            let of_report = frame.kind == Kind::Single(Class::Status) && frame.destination() == origin;
            of_report
                .then(|| Report::parse(frame.section_for(origin).expect("a section").data).expect("a report"))
        });
        reports.next_back().expect("it was asked")
    }

    fn control(&mut self, origin: u8, control: Control) -> (State, Option<Refusal>) {
        let report = self.say(origin, control, GAINS, 5_010.0);
        (report.state, report.refused)
    }

    /// Puts it under current, held.
    fn enable(&mut self, origin: u8) {
        self.control(origin, Control::Observe);
        assert_eq!(self.control(origin, Control::Hold), (State::Starting, None));
        self.wait(21);
        assert_eq!(self.control(origin, Control::Hold), (State::Held, None));
    }

    fn state(&self) -> State {
        self.module.status().state
    }

    fn set_point(&self) -> i64 {
        self.module.status().set_point
    }
}

#[test]
fn enable_follow_hold_off() {
    let mut rig = Rig::new();
    rig.enable(1);
    assert_eq!(rig.node.commander(), Some(1));
    assert_eq!(rig.set_point(), 5_000, "no jump");
    assert_eq!(rig.control(1, Control::Follow), (State::Enabled, None));
    assert_eq!(rig.set_point(), 5_010);
    assert_eq!(rig.control(1, Control::Observe), (State::Enabled, None));
    assert_eq!(rig.control(1, Control::Hold), (State::Held, None));
    assert_eq!(rig.set_point(), 5_000, "it is held where it is");
    assert_eq!(rig.control(1, Control::Off), (State::Disabled, None));
}

#[test]
fn a_repeated_hold_puts_nothing_under_current() {
    let mut rig = Rig::new();
    // As after power-up, while a gateway goes on with its cycle.
    for control in [Control::Hold, Control::Hold] {
        assert_eq!(rig.control(1, control), (State::Disabled, Some(Refusal::NoEdge)));
    }
    assert_eq!(rig.control(1, Control::Follow), (State::Disabled, Some(Refusal::HoldFirst)));
    rig.enable(1);
    // Another switches it off.
    assert_eq!(rig.control(2, Control::Off), (State::Disabled, None));
    assert_eq!(rig.control(1, Control::Hold), (State::Disabled, Some(Refusal::NoEdge)));
    assert_eq!(rig.control(1, Control::Follow), (State::Disabled, Some(Refusal::HoldFirst)));
    rig.enable(1);
}

/// The reason why an enable failed is told for as long as the Hold is repeated, for not every one of them is asked.
#[test]
fn why_a_hold_was_refused_is_told_again() {
    let mut rig = Rig::new();
    rig.encoder = Err(EncoderFault::Line);
    rig.wait(2);
    rig.control(1, Control::Off);
    for _ in 0..3 {
        assert_eq!(rig.control(1, Control::Hold), (State::Disabled, Some(Refusal::NoPosition)));
    }
    assert_eq!(rig.control(2, Control::Hold), (State::Disabled, Some(Refusal::NoEdge)));
    rig.encoder = Ok(5_000);
    rig.wait(2);
    assert_eq!(rig.control(1, Control::Hold).0, State::Disabled, "nor does it start when the reason is gone");
    rig.control(1, Control::Off);
    let report = rig.say(1, Control::Hold, [0.0; 3], 0.0);
    assert_eq!((report.state, report.refused), (State::Disabled, Some(Refusal::Gains)));
    let report = rig.say(1, Control::Hold, [-1.0, 0.0, 0.0], 0.0);
    assert_eq!((report.state, report.refused), (State::Disabled, Some(Refusal::Gains)));
    rig.enable(1);
}

#[test]
fn anyone_may_stop_and_only_the_commander_may_move() {
    let mut rig = Rig::new();
    rig.enable(1);
    assert_eq!(rig.control(1, Control::Follow), (State::Enabled, None));
    assert_eq!(rig.control(2, Control::Follow), (State::Enabled, Some(Refusal::Commander)));
    let report = rig.say(2, Control::Follow, [0.5, 0.0, 0.0], 9.0);
    assert_eq!((report.state, rig.set_point()), (State::Enabled, 5_010));
    // Another's Hold stops it, whether or not the other has an edge.
    rig.control(2, Control::Observe);
    assert_eq!(rig.control(2, Control::Hold), (State::Held, Some(Refusal::Commander)));
    assert_eq!(rig.node.commander(), Some(1));
    assert_eq!(rig.control(1, Control::Follow), (State::Held, Some(Refusal::HoldFirst)));
    assert_eq!(rig.control(1, Control::Hold), (State::Held, None));
    assert_eq!(rig.control(1, Control::Follow), (State::Enabled, None));
    assert_eq!(rig.control(2, Control::Off), (State::Disabled, None));
}

#[test]
fn gains_count_from_the_commander() {
    let mut rig = Rig::new();
    rig.enable(1);
    rig.control(1, Control::Follow);
    let full = |rig: &mut Rig, gains| {
        let report = rig.say(1, Control::Follow, gains, 5_010.0);
        rig.wait(1);
        (report.refused, (rig.module.status().command * 100.0).round())
    };
    assert_eq!(full(&mut rig, GAINS), (None, 10.0));
    assert_eq!(full(&mut rig, [0.05, 0.0, 0.0]), (None, 50.0));
    rig.say(2, Control::Follow, [0.01, 0.0, 0.0], 5_010.0);
    rig.say(2, Control::Off, [0.01, 0.0, 0.0], 5_010.0);
    rig.enable(1);
    // What cannot hold it is refused; the set-point counts all the same.
    assert_eq!(full(&mut rig, [0.05, 0.0, 0.0]), (None, 50.0));
    assert_eq!(full(&mut rig, [0.0, 0.0, 0.0]), (Some(Refusal::Gains), 50.0));
    let report = rig.say(1, Control::Follow, [0.0; 3], 5_001.0);
    assert_eq!((report.refused, rig.set_point()), (Some(Refusal::Gains), 5_001));
}

/// The commander's Hold and Follow do, and nothing else.
#[test]
fn what_keeps_the_supervision_content() {
    for (origin, control, faults) in [
        (1, Control::Hold, false),
        (1, Control::Follow, false),
        (1, Control::Observe, true),
        (2, Control::Follow, true),
        (2, Control::Hold, true),
    ] {
        let mut rig = Rig::new();
        rig.enable(1);
        for _ in 0..4 {
            rig.wait(40);
            rig.control(origin, control);
        }
        let fault = State::Fault(Cause::Communication);
        assert_eq!(rig.state() == fault, faults, "{origin} {control:?}");
        assert_eq!(rig.control(1, Control::Hold).1, faults.then_some(Refusal::Fault));
        if faults {
            assert_eq!(rig.control(1, Control::Follow), (fault, Some(Refusal::Fault)));
            assert_eq!(rig.control(1, Control::Observe), (fault, None));
            assert_eq!(rig.control(2, Control::Off), (State::Disabled, None), "anyone may acknowledge");
        }
    }
}

/// The commander is stopped by another: his Follow is refused, but he is there.
#[test]
fn a_refused_follow_of_the_commander_is_a_sign_of_life() {
    let mut rig = Rig::new();
    rig.enable(1);
    rig.control(2, Control::Hold);
    for _ in 0..4 {
        rig.wait(40);
        assert_eq!(rig.control(1, Control::Follow), (State::Held, Some(Refusal::HoldFirst)));
    }
}

#[test]
fn what_makes_no_sense_changes_nothing() {
    let mut rig = Rig::new();
    rig.enable(1);
    rig.control(1, Control::Follow);
    for data in [&b"what?4"[..], b"10101010", b"4", b"3nan1010144", b"10101010164"] {
        let report = rig.say_data(1, &[data, b"6"].concat());
        assert_eq!((report.state, report.refused), (State::Enabled, Some(Refusal::Meaningless)), "{data:?}");
    }
    for set_point in [16_777_218.0, -16_777_218.0] {
        let report = rig.say(1, Control::Follow, GAINS, set_point);
        assert_eq!((report.refused, rig.set_point()), (Some(Refusal::Meaningless), 5_010));
    }
    let report = rig.say(1, Control::Follow, GAINS, 16_777_216.0);
    assert_eq!((report.refused, rig.set_point()), (None, 16_777_216));
}

/// A gateway's frame with sections for others, too.
#[test]
fn the_turn_is_counted_among_those_that_ask() {
    let data = |control, ask| {
        let order = Some(Order { control, ask });
        Setting { order, ..Setting::default() }.emit(Form::Text).expect("it fits")
    };
    let wait = |before: &[(u8, bool)], ask| {
        let mut rig = Rig::new();
        let mut frame = heapless::Vec::<u8, 300>::new();
        frame::build(&mut frame, 1, Kind::Single(Class::Data), |body| {
            for (address, ask) in before {
                section::push(body, *address, &data(Control::Hold, *ask))?;
            }
            Ok(section::push(body, 17, &data(Control::Observe, ask))?)
        })
        .expect("a frame");
        let begun = rig.now + Duration::from_micros(10 * frame.len() as u64);
        for byte in &frame {
            rig.now += Duration::from_micros(10);
            rig.node.receive(rig.now, *byte);
            while rig.node.poll(rig.now, &mut rig.module) != node::Action::Idle {}
        }
        rig.node.poll_at().map(|at| at.since(begun))
    };
    let us = Duration::from_micros;
    assert_eq!(wait(&[], true), Some(us(20)), "after a gap");
    assert_eq!(wait(&[(18, false), (19, false)], true), Some(us(20)));
    // 35 characters and a gap each, less half an answer.
    assert_eq!(wait(&[(18, true)], true), Some(us(20 + 370 - 175)));
    assert_eq!(wait(&[(18, true), (0, true), (19, true)], true), Some(us(20 + 2 * 370 - 175)));
    assert_eq!(wait(&[(18, true)], false), None);
}

proptest! {
    /// Whatever three stations say: what the rules come down to.
    #[test]
    fn the_rules_hold(
        steps in prop::collection::vec((1..=3_u8, 0..5_u8, -100..100_i32, 0..60_u64), 1..80),
    ) {
        let mut rig = Rig::new();
        let mut edges = [false; 4];
        for (origin, what, set_point, pause) in steps {
            rig.wait(pause);
            let before = rig.state();
            let (target, commander) = (rig.set_point(), rig.node.commander());
            let set_point = 5_000 + set_point;
            let control = match what {
                0 => Control::Off,
                1 => Control::Hold,
                2 => Control::Follow,
                _ => Control::Observe,
            };
            let report = rig.say(origin, control, GAINS, set_point as f32);
            let edge = std::mem::replace(
                &mut edges[usize::from(origin)],
                matches!(control, Control::Off | Control::Observe),
            );
            prop_assert_eq!(report.state, rig.state());
            let commands = commander == Some(origin);
            let expected = match (before, control) {
                (_, Control::Off) => State::Disabled,
                (_, Control::Observe) | (State::Fault(_), _) => before,
                (State::Disabled, Control::Hold) if edge => State::Starting,
                (State::Disabled, _) | (State::Starting, _) => before,
                (_, Control::Hold) => State::Held,
                (_, Control::Follow) if commands && report.refused.is_none() => State::Enabled,
                (_, Control::Follow) => before,
            };
            prop_assert_eq!(report.state, expected);
            if report.state == State::Enabled {
                let followed = control == Control::Follow && commands && report.refused.is_none();
                prop_assert_eq!(rig.set_point(), if followed { set_point.into() } else { target });
            }
            if commander != rig.node.commander() {
                prop_assert!(before == State::Disabled && control == Control::Hold && edge);
            }
        }
    }
}
