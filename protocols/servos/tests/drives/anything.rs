//! Whatever happens, in whatever order.

use std::time::Duration;

use proptest::prelude::*;
use puente_canopen::manager::{Config, Member};
use puente_canopen::{Frame, Id, NodeId};
use puente_drives::cia402::homing::Method;
use puente_drives::cia402::{Mode, Profile};
use puente_line::Instant;
use puente_servos::{Action, Axis, Master, Motion, Order};

use crate::rig::{Rig, axis, cyclic};

pub fn orders() -> impl Strategy<Value = Order> {
    let position = (any::<i16>(), any::<bool>(), 0..3_u32, prop::option::of(1..100_u32));
    let motion = prop_oneof![
        position.prop_map(|(target, relative, serial, velocity)| Motion::Position {
            target: target.into(),
            velocity,
            relative,
            serial
        }),
        (-50..50).prop_map(Motion::Velocity),
        (-500..500_i16).prop_map(Motion::Torque),
        (0..3_u32, prop::option::of(17..36_i8))
            .prop_map(|(serial, method)| Motion::Home { method: method.and_then(Method::new), serial }),
        (-500..500).prop_map(Motion::Interpolate),
        any::<i8>().prop_map(|code| Motion::Mode(Mode::from_code(code).unwrap_or(Mode::JOG))),
    ];
    prop_oneof![
        Just(Order::Observe),
        Just(Order::Off),
        Just(Order::Stop),
        (0..3_u32).prop_map(|serial| Order::Reset { serial }),
        Just(Order::Hold),
        motion.prop_map(Order::Move),
    ]
}

#[derive(Clone, Debug)]
enum Event {
    Order(usize, Order),
    Run(u64),
    Fault(usize),
    Reboot(usize),
    Dead(usize, bool),
    Status(usize, &'static str),
    Stubborn(usize, bool),
    Nmt(usize, u8),
    Bus(bool),
}

const STATES: [&str; 7] =
    ["switch on disabled", "ready", "switched on", "enabled", "quick stop", "fault reaction", "fault"];

fn events() -> impl Strategy<Value = Event> {
    prop_oneof![
        6 => (0..2_usize, orders()).prop_map(|(place, order)| Event::Order(place, order)),
        6 => (1..400_u64).prop_map(Event::Run),
        1 => (0..2_usize).prop_map(Event::Fault),
        1 => (0..2_usize).prop_map(Event::Reboot),
        1 => (0..2_usize, any::<bool>()).prop_map(|(place, dead)| Event::Dead(place, dead)),
        1 => (0..2_usize, prop::sample::select(&STATES[..])).prop_map(|(place, state)| Event::Status(place, state)),
        1 => (0..2_usize, any::<bool>()).prop_map(|(place, stubborn)| Event::Stubborn(place, stubborn)),
        1 => (0..2_usize, prop::sample::select(&[4_u8, 5, 127][..])).prop_map(|(place, nmt)| Event::Nmt(place, nmt)),
        1 => any::<bool>().prop_map(Event::Bus),
    ]
}

/// What a frame tells a drive: its controlword.
fn word(frame: &Frame, node: u8) -> Option<u16> {
    let Id::Base(id) = frame.id() else { return None };
    let of_node = (1..=4).any(|number| id == 0x100 + 0x100 * number + u16::from(node));
    let &[low, high, ..] = frame.data() else { return None };
    (of_node && !(id >> 8 == 5 && frame.length() == 4)).then_some(u16::from_le_bytes([low, high]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// With devices that do whatever they like.
    #[test]
    fn nothing_moves_that_is_not_to(events in prop::collection::vec(events(), 1..40), synchronous: bool) {
        let (axes, sync) = match synchronous {
            true => ([cyclic(2, Mode::InterpolatedPosition), cyclic(3, Mode::CyclicPosition)], 2),
            false => ([axis(2, &Profile::LEXIUM_23A), axis(3, &Profile::GENERIC)], 0),
        };
        let mut rig = Rig::new(&axes, Duration::from_millis(sync)).boot();
        for event in events {
            match event {
                Event::Order(place, order) => rig.set(place, order),
                Event::Run(time) => {
                    for _ in 0..time {
                        let moves = [0, 1].map(|place| matches!(rig.master.order(place), Order::Move(_)));
                        rig.sent.clear();
                        rig.run_ms(1);
                        for (_, frame) in &rig.sent {
                            for (node, moves) in (2..).zip(moves) {
                                let Some(word) = word(frame, node) else { continue };
                                prop_assert!(word & 0x10 == 0 || moves, "{word:04X}");
                                prop_assert!(word & 0x108 != 0x100, "a halt without current: {word:04X}");
                            }
                        }
                    }
                }
                Event::Fault(place) => rig.devices[place].fail(0x8611),
                Event::Reboot(place) => rig.devices[place].boot(),
                Event::Dead(place, dead) => rig.devices[place].dead = dead,
                Event::Status(place, state) => rig.devices[place].power.state = state,
                Event::Stubborn(place, stubborn) => rig.devices[place].stubborn = stubborn,
                Event::Nmt(place, nmt) => rig.devices[place].nmt = nmt,
                Event::Bus(up) => {
                    rig.cut = !up;
                    rig.master.bus(rig.now, up);
                }
            }
            for (place, device) in rig.devices.iter().enumerate() {
                prop_assert!(!device.jumps, "{place}: {:X?}", device.words);
            }
        }
    }

    /// With any frames at all, and at any times.
    #[test]
    fn any_frames_are_survived(
        steps in prop::collection::vec((any::<u8>(), 0..0x800_u16, prop::collection::vec(any::<u8>(), 0..9), orders(), 0..2_000_000_u64), 1..200),
        synchronous: bool,
    ) {
        let node = |id| NodeId::new(id).expect("a node-ID");
        let axes = [2, 3].map(|id| Axis { cyclic: Some(Mode::InterpolatedPosition), ..Axis::new(node(id), &Profile::GENERIC) });
        let sync = Duration::from_millis(if synchronous { 1 } else { 0 });
        let mut now = Instant::ZERO;
        let config = Config { sync, ..Config::new(NodeId::MAX) };
        let members = [2, 3].map(|id| Member::new(node(id)));
        let mut master: Master<'_, 2, 2, 2> = Master::new(config, members, axes, now);
        master.start(now);
        for (what, id, data, order, time) in steps {
            now += Duration::from_micros(time / 8_u64.pow(u32::from(what % 8)));
            // Mostly from the drives.
            let id = if what & 0x10 == 0 { id & 0x780 | 2 | id & 1 } else { id };
            match what >> 5 {
                0 => master.set(now, usize::from(what & 1), order),
                1 => master.bus(now, what & 1 == 0),
                _ => master.receive(now, &Frame::new(Id::base(id), &data).expect("8 bytes")),
            }
            for round in 0.. {
                prop_assert!(round < 1_000, "it never rests");
                match master.poll(now) {
                    Action::Idle => break,
                    Action::Transmit(frame) => for place in 0..2 {
                        let Some(word) = word(&frame, 2 + place as u8) else { continue };
                        prop_assert!(word & 0x08 == 0 || master.order(place).wants_current());
                        prop_assert!(word & 0x10 == 0 || matches!(master.order(place), Order::Move(_)));
                    },
                    _ => {}
                }
            }
            prop_assert!(master.poll_at().is_none_or(|at| at > now));
        }
    }
}
