//! Whatever the line says, a module's end neither panics nor spins, sends frames only, and moves for its commander alone.
#![no_main]

use std::time::Duration;

use puente_drives::pid::{Config, Encoder, EncoderFault, Input, Module, State, Width};
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Class, Kind, Session, section, station};
use puente_fuzz::{Operands, line};
use puente_line::Instant;
use puente_modules::{Form, Node, Order, Setting, node};

/// A well-formed frame from somebody: orders, settings of the thesis, answers to what the module says.
fn foreign(operands: &mut Operands<'_>, session: Session) -> Vec<u8> {
    let what = operands.byte();
    let kind = match what & 7 {
        0..=3 => Kind::Single(Class::Data),
        4 => Kind::Plain,
        5 => Kind::Consent { session, window: 1 + operands.byte() % 8 },
        6 => Kind::Acknowledgement { next: operands.byte(), held: 0, session },
        _ => Kind::Opening { sender: 1 + u16::from(operands.byte()) },
    };
    let setting = Setting {
        kp: f32::from(operands.byte()) / 64.0,
        set_point: f32::from(operands.byte()) * 8.0,
        order: (what & 8 == 0).then(|| Order::from_digit(b'0' + operands.byte() % 8)).flatten(),
        ..Setting::default()
    };
    let data = setting.emit(Form::Text).expect("it fits");
    let mut buffer = heapless::Vec::<u8, MAX_FRAME>::new();
    frame::build(&mut buffer, 1 + (what >> 4) % 3, kind, |body| {
        if what & 0x40 != 0 {
            section::push(body, 18, &data)?;
        }
        Ok(section::push(body, 17, if kind == Kind::Plain || what & 4 == 0 { &data } else { &[] })?)
    })
    .expect("a frame");
    buffer.to_vec()
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let mut now = Instant::from_millis(5_000);
    let station = station::Config::new(17, line(), 64);
    let config = Config { rate: 1_000, ..Config::new(Encoder::Binary(Width::W16)) };
    let mut module = Module::new(config).expect("settings");
    let mut node =
        Node::<1, 2, 300>::new(node::Config { station, form: Form::Text }, now, u64::from(operands.byte()));
    let mut session = Session { sender: 1, receiver: 1 };
    while !operands.0.is_empty() {
        let event = operands.byte();
        let heard = match event & 7 {
            0 => operands.bytes(usize::from(event >> 3)).to_vec(),
            1..=4 => foreign(&mut operands, session),
            5 => {
                node.carrier(now);
                Vec::new()
            }
            6 => {
                node.line_error(now);
                Vec::new()
            }
            _ => {
                now += operands.pause();
                Vec::new()
            }
        };
        let encoder = if event == 0xFF { Err(EncoderFault::Line) } else { Ok(1_000) };
        for _ in 0..=event >> 4 {
            let output = module.step(Input { encoder, amplifier_fault: event == 0xEF, now });
            if let Some(event) = output.event {
                node.event(event);
            }
        }
        let mut heard = heard;
        let mut at = 0;
        for _ in 0..20_000 {
            let before = (module.status(), node.commander());
            match node.poll(now, &mut module) {
                node::Action::Transmit(bytes) => {
                    let frame = frame::parse(bytes).expect("it sends frames");
                    assert_eq!(frame.origin, 17);
                    if let Kind::Opening { sender } = frame.kind {
                        session = Session { sender, receiver: 1 };
                    }
                    // Its echo, or another's voice.
                    if event & 0x80 == 0 {
                        heard.extend(bytes);
                    }
                }
                node::Action::Jam(_) => {}
                node::Action::Idle => {
                    assert!(node.poll_at().is_none_or(|at| at > now), "polling would spin");
                    let Some(byte) = heard.get(at) else { break };
                    now += Duration::from_micros(573);
                    node.receive(now, *byte);
                    at += 1;
                }
            }
            let (status, state) = (module.status(), before.0.state);
            if status.state != State::Disabled && state == State::Disabled {
                assert_eq!(status.state, State::Starting);
                assert!(node.commander().is_some());
            } else if state != State::Disabled {
                assert_eq!(node.commander(), before.1, "who commands changes with an enable only");
            }
        }
        assert_eq!(at, heard.len(), "it spins");
    }
});
