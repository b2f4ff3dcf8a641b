//! Whatever the bus says, a master of drives neither panics nor spins, and no drive is told to go under current, or to move,
//! that is not to.
#![no_main]

use std::time::Duration;

use puente_canopen::manager::{Action as Managed, Config, Member, Sdo};
use puente_canopen::sdo::Transfer;
use puente_canopen::{Address, Frame, Id, NodeId, nmt};
use puente_drives::cia402::homing::Method;
use puente_drives::cia402::{Mode, Profile};
use puente_fuzz::Operands;
use puente_line::Instant;
use puente_servos::{Action, Axis, Master, Motion, Order};

type Own = Master<'static, 2, 2, 2>;

fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("a node-ID")
}

fn order(operands: &mut Operands<'_>) -> Order {
    let [what, a, b] = [operands.byte(), operands.byte(), operands.byte()];
    Order::Move(match what % 12 {
        0 => return Order::Observe,
        1 => return Order::Off,
        2 => return Order::Stop,
        3 => return Order::Reset { serial: a.into() },
        4 => return Order::Hold,
        5 => Motion::Position { target: a.into(), velocity: None, relative: b & 1 == 0, serial: b.into() },
        6 => Motion::Position { target: a.into(), velocity: Some(b.into()), relative: false, serial: 0 },
        7 => Motion::Velocity(i32::from(a) - 128),
        8 => Motion::Torque(i16::from(a) - 128),
        9 => Motion::Home { method: Method::new(a as i8), serial: b.into() },
        10 => Motion::Interpolate(i32::from_be_bytes([a, b, a, b])),
        _ => Motion::Mode(Mode::from_code(a as i8).unwrap_or(Mode::None)),
    })
}

/// What a node says: to its PDOs, its SDO client, its monitor.
fn frame(operands: &mut Operands<'_>) -> Frame {
    let [what, low, high] = [operands.byte(), operands.byte(), operands.byte()];
    let node = 2 | u16::from(what & 1);
    let functions = [0x180, 0x280, 0x380, 0x480, 0x580, 0x700, 0x080, 0x000];
    let id = functions[usize::from(what >> 1 & 7)] + if what & 0x0E == 0x0E { 0 } else { node };
    let data = operands.bytes(6);
    let whole: Vec<u8> = [low, high].into_iter().chain(data.iter().copied()).collect();
    let id = if what & 0xF0 == 0xF0 { Id::base(u16::from_le_bytes([low, high])) } else { Id::base(id) };
    Frame::new(id, &whole[..whole.len().min(usize::from(what >> 4) + 1).min(8)]).expect("8 bytes")
}

/// An answer that the SDO client expects, so that something comes of what it asks.
fn answer(asked: &Frame, value: u8, refused: bool) -> Frame {
    let &[command, low, high, sub, ..] = asked.data() else { panic!("a request") };
    let command = match command {
        _ if refused => 0x80,
        0x40 => 0x43 | (value & 3) << 2,
        _ => 0x60,
    };
    Frame::full(Id::base(asked.id().raw() as u16 - 0x80), [command, low, high, sub, value, value >> 4, 0, 0])
}

fn judge(frame: &Frame, master: &Own) {
    for place in 0..2 {
        let words = [0x200, 0x300, 0x400].map(|function| Id::base(function + 2 + place as u16));
        if !words.contains(&frame.id()) {
            continue;
        }
        let word = u16::from_le_bytes([frame.data()[0], frame.data()[1]]);
        assert!(word & 0x08 == 0 || master.order(place).wants_current(), "{word:04X}");
        assert!(word & 0x10 == 0 || matches!(master.order(place), Order::Move(_)), "{word:04X}");
        assert!(word & 0x80 == 0 || matches!(master.order(place), Order::Reset { .. }), "{word:04X}");
    }
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let setting = operands.byte();
    let cyclic =
        [None, Some(Mode::InterpolatedPosition), Some(Mode::CyclicVelocity)][usize::from(setting % 3)];
    let axes = [2, 3].map(|id| Axis {
        cyclic,
        ..Axis::new(node(id), Profile::ALL[usize::from(setting >> 2) % Profile::ALL.len()])
    });
    let sync = Duration::from_millis(u64::from(setting >> 6));
    let config = Config { sync, ..Config::new(NodeId::MAX) };
    let mut now = Instant::ZERO;
    let mut master: Own = Master::new(config, [2, 3].map(|id| Member::new(node(id))), axes, now);
    master.start(now);
    let mut asked = None;
    while !operands.0.is_empty() {
        let what = operands.byte();
        now += Duration::from_micros(u64::from(what & 0x0F).pow(5));
        match what >> 4 {
            0..=2 => {
                let place = usize::from(what & 1);
                let order = order(&mut operands);
                master.set(now, place, order);
            }
            3..=6 => master.receive(now, &frame(&mut operands)),
            7..=11 => {
                if let Some(asked) = asked.take() {
                    master.receive(now, &answer(&asked, operands.byte(), what >> 4 == 11));
                }
            }
            12 => master.bus(now, what & 1 == 0),
            13 => {
                let transfer = Transfer::Upload { address: Address::new(0x1008, 0), block: what & 1 == 0 };
                let _ = master.submit(now, node(2), transfer);
            }
            14 => {
                let command = nmt::Command::from_code(operands.byte()).unwrap_or(nmt::Command::Start);
                let _ = master.command(now, command, Some(node(2)));
            }
            _ => {}
        }
        for round in 0.. {
            assert!(round < 1_000, "it never rests");
            match master.poll(now) {
                Action::Idle => break,
                Action::Transmit(frame) => {
                    judge(&frame, &master);
                    if frame.id().raw() & 0x780 == 0x600 {
                        asked = Some(frame);
                    }
                }
                Action::Manager(Managed::Sdo(node, Sdo::Fetch { .. })) => {
                    master.manager_mut().supply(now, node, &[]);
                }
                _ => {}
            }
        }
        assert!(master.poll_at().is_none_or(|at| at > now));
    }
});
