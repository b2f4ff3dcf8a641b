//! Whatever the line says, a gateway's end neither panics nor spins, and what it sends says what is wanted.
#![no_main]

use std::time::Duration;

use puente_drives::pid::{Cause, Gains, State};
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Class, Kind, Number, Session, section, station};
use puente_fuzz::{Operands, line};
use puente_line::Instant;
use puente_modules::master::{Action, Axis, Config, Output};
use puente_modules::{Control, Form, Master, Report, Setting};

const AXES: [(u8, Form); 2] = [(17, Form::Text), (18, Form::Binary)];
const STATES: [State; 5] =
    [State::Disabled, State::Starting, State::Enabled, State::Held, State::Fault(Cause::Amplifier)];
const CONTROLS: [Control; 4] = [Control::Off, Control::Hold, Control::Follow, Control::Observe];

/// A well-formed frame from a module or from another gateway.
fn foreign(operands: &mut Operands<'_>, session: Session) -> Vec<u8> {
    let what = operands.byte();
    let state = STATES[usize::from(operands.byte()) % STATES.len()];
    let report =
        Report { state, refused: None, position: 0, following_error: 0, velocity: 0.0, command: 0.0 };
    let (kind, data) = match what & 7 {
        0..=3 => (Kind::Single(Class::Status), report.emit().to_vec()),
        4 => (Kind::Opening { sender: session.sender }, Vec::new()),
        5 => {
            let number = Number::new(operands.byte().into());
            (Kind::Numbered { number, class: Class::Event, session }, vec![operands.byte() % 8])
        }
        6 => (Kind::Plain, operands.bytes(20).to_vec()),
        _ => (Kind::Single(Class::Data), operands.bytes(20).to_vec()),
    };
    let mut buffer = heapless::Vec::<u8, MAX_FRAME>::new();
    let to = if what & 0x80 == 0 { 1 } else { 2 };
    frame::build(&mut buffer, 16 + (what >> 4) % 4, kind, |body| Ok(section::push(body, to, &data)?))
        .expect("a frame");
    buffer.to_vec()
}

type Own = Master<2, 1, 2, 160>;

/// The frame of a cycle says what is wanted.
fn judge(frame: &frame::Frame<'_>, master: &Own) {
    if frame.kind != Kind::Single(Class::Data) || frame.origin != 1 {
        return;
    }
    let mut asked = 0;
    for (section, (at, (address, form))) in frame.sections().zip(AXES.into_iter().enumerate()) {
        assert_eq!(section.address, address);
        let setting = Setting::parse(form, section.data).expect("a setting");
        let order = setting.order.expect("an order");
        asked += u32::from(order.ask);
        assert_eq!(order.control, master.output(at).control);
        if matches!(order.control, Control::Hold | Control::Follow) {
            assert_eq!(setting.counts(), Some(master.output(at).set_point));
        }
    }
    assert!(asked > 0);
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let mut now = Instant::from_millis(5_000);
    let cycle = Duration::from_millis(u64::from(operands.byte()));
    let config = Config { station: station::Config::new(1, line(), 64), cycle };
    let axes = AXES.map(|(address, form)| Axis { address, form });
    let mut master = Own::new(config, axes, now, u64::from(operands.byte()));
    let mut session = Session { sender: 1, receiver: 1 };
    let mut posted = 0_i32;
    let mut refused = false;
    while !operands.0.is_empty() {
        let event = operands.byte();
        let mut heard = match event & 7 {
            0 => operands.bytes(usize::from(event >> 3)).to_vec(),
            1 | 2 => foreign(&mut operands, session),
            3 => {
                let control = CONTROLS[usize::from(event >> 3) % 4];
                let set_point = i32::from(operands.byte()) << (event >> 5) * 4;
                let gains = Gains::new(f32::from(operands.byte()) / 1e3, 0.0, 1e-9).expect("gains");
                master.set(usize::from(event >> 7), Output { control, gains, set_point });
                Vec::new()
            }
            4 => {
                let frame = foreign(&mut operands, session);
                refused = master.post(now, &frame).is_err();
                posted += i32::from(!refused);
                Vec::new()
            }
            5 => {
                master.carrier(now);
                Vec::new()
            }
            6 => {
                master.line_error(now);
                Vec::new()
            }
            _ => {
                now += operands.pause();
                Vec::new()
            }
        };
        let mut at = 0;
        for _ in 0..20_000 {
            match master.poll(now) {
                Action::Transmit(bytes) => {
                    let bytes = bytes.to_vec();
                    let frame = frame::parse(&bytes).expect("it sends frames");
                    judge(&frame, &master);
                    if let Kind::Consent { session: offered, .. } = frame.kind {
                        session = offered;
                    }
                    if event & 0x80 == 0 {
                        heard.extend(bytes);
                    }
                }
                Action::Heard(bytes) => {
                    frame::parse(bytes).expect("a whole frame");
                }
                Action::Fell { axis, to } => assert_eq!(master.output(axis).control, to),
                Action::Posted(_) => {
                    posted -= 1;
                    assert!(posted >= 0, "reported twice");
                }
                Action::Reported { axis, .. } | Action::Event { axis, .. } | Action::Missed { axis } => {
                    assert!(axis < 2)
                }
                Action::Jam(_) => {}
                Action::Idle => {
                    let waits = master.poll_at().is_none_or(|at| at > now);
                    // Once, so that a client that was refused can try again.
                    assert!(waits || std::mem::take(&mut refused), "polling would spin");
                    if !waits {
                        continue;
                    }
                    let Some(byte) = heard.get(at) else { break };
                    now += Duration::from_micros(573);
                    master.receive(now, *byte);
                    at += 1;
                }
            }
        }
        assert_eq!(at, heard.len(), "it spins");
        assert!(posted <= 1);
    }
});
