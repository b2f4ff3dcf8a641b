//! What goes wrong, and what becomes of the axes.

use std::time::Duration;

use puente_drives::pid::{Cause, Event, State};
use puente_framed::arbiter::Failure;
use puente_framed::{Class, Kind, frame, section, station};
use puente_line::{Instant, Settings};
use puente_modules::master::{Action, Axis, Config};
use puente_modules::{Control, Form, Master, Order, Setting};

use crate::rig::Rig;

const AXES: [(u8, Form); 3] = [(17, Form::Binary), (18, Form::Text), (19, Form::Binary)];

/// A gateway with three axes that follow a set-point far away.
fn moving(noise: f64, seed: u64) -> Rig {
    let mut rig = Rig::new(noise, seed);
    rig.gateway(1, 4, &AXES);
    for (address, form) in AXES {
        rig.module(address, form);
    }
    rig.ghost(9);
    rig.enable(1, &[0, 1, 2]);
    for axis in 0..3 {
        rig.want(1, axis, Control::Follow, 1_100_000);
    }
    rig.run_ms(20);
    rig
}

/// A gateway's frame for one module, in any station's name.
fn order(origin: u8, address: u8, control: Control) -> Vec<u8> {
    let order = Some(Order { control, ask: false });
    let data = Setting { kp: 0.01, order, ..Setting::default() }.emit(Form::Binary).expect("it fits");
    let mut buffer = heapless::Vec::<u8, 128>::new();
    frame::build(&mut buffer, origin, Kind::Single(Class::Data), |body| {
        Ok(section::push(body, address, &data)?)
    })
    .expect("a frame");
    buffer.to_vec()
}

#[test]
fn a_third_party_stops_an_axis() {
    let mut rig = moving(0.0, 1);
    rig.ghost_at(9).frames = vec![order(9, 17, Control::Hold)];
    rig.run_ms(20);
    assert_eq!(rig.at(1).fell, [(0, Control::Hold)]);
    assert_eq!(rig.at(1).master.output(0).control, Control::Hold);
    let stopped = rig.of(17).position;
    rig.run_ms(300);
    assert_eq!(rig.of(17).state(), State::Held);
    assert!((rig.of(17).position - stopped).abs() < 300.0, "it came to rest");
    assert_eq!([18, 19].map(|address| rig.of(address).state()), [State::Enabled; 2]);
    // Its gateway goes on when it wants to: it has said Hold.
    rig.want(1, 0, Control::Follow, 1_100_000);
    rig.run_ms(20);
    assert_eq!(rig.of(17).state(), State::Enabled);
    assert_eq!(rig.at(1).fell.len(), 1);
    // Off is for good.
    rig.ghost_at(9).frames = vec![order(9, 17, Control::Off)];
    rig.run_ms(20);
    assert_eq!(rig.at(1).fell[1..], [(0, Control::Observe)]);
    assert_eq!(rig.of(17).state(), State::Disabled);
}

#[test]
fn a_module_that_was_switched_off_and_on_stays_without_current() {
    let mut rig = moving(0.0, 1);
    rig.kill(18);
    rig.run_ms(30);
    let gateway = rig.at(1);
    assert!(gateway.missed.len() > 3 && gateway.missed.iter().all(|axis| *axis == 1), "{:?}", gateway.missed);
    assert!(gateway.fell.is_empty(), "nobody knows what it is at");
    let anew = rig.module_side(18, Form::Text);
    rig.replace(18, anew);
    rig.run_ms(20);
    assert_eq!(rig.at(1).fell, [(1, Control::Observe)]);
    assert_eq!(rig.of(18).state(), State::Disabled);
    assert_eq!([17, 19].map(|address| rig.of(address).state()), [State::Enabled; 2]);
    rig.enable(1, &[1]);
}

/// A packet that something on the way has kept back and gives now.
#[test]
fn a_packet_of_the_past_moves_nothing() {
    let mut rig = moving(0.0, 1);
    let (_, stale) = rig.at(1).sent.last().expect("a frame").clone();
    for axis in 0..3 {
        rig.want(1, axis, Control::Off, 0);
    }
    rig.run_ms(20);
    rig.kill(1);
    let positions = [17, 18, 19].map(|address| rig.of(address).position);
    for _ in 0..5 {
        rig.ghost_at(9).frames = vec![stale.clone()];
        rig.run_ms(10);
        assert_eq!([17, 18, 19].map(|address| rig.of(address).state()), [State::Disabled; 3]);
    }
    assert_eq!([17, 18, 19].map(|address| rig.of(address).position), positions);
}

/// A module that is not heard any more stops by itself, and says so when it is heard again; its gateway falls back.
#[test]
fn a_fault_is_told_and_taken_back() {
    let mut rig = moving(0.0, 1);
    let seat = rig.seat(17);
    rig.line.place(seat).deaf = true;
    rig.line.place(seat).judged = false;
    rig.run_ms(105);
    assert_eq!(rig.of(17).state(), State::Fault(Cause::Communication));
    rig.line.place(seat).deaf = false;
    rig.run_ms(200);
    assert_eq!(rig.at(1).fell, [(0, Control::Observe)]);
    let fault = (0, Event::Fault(Cause::Communication));
    let events: Vec<_> = rig.at(1).events.iter().filter(|event| event.0 == 0).copied().collect();
    assert_eq!(events, [(0, Event::Enabled), fault], "once each, by the window");
    rig.want(1, 0, Control::Off, 0);
    rig.run_ms(20);
    assert_eq!(rig.of(17).state(), State::Disabled);
    rig.enable(1, &[0]);
}

/// The gateway has started anew, and knows nothing of the window that the module has to it.
#[test]
fn a_gateway_that_started_anew_is_told_too() {
    let mut rig = moving(0.0, 1);
    assert!(rig.at(1).events.contains(&(0, Event::Enabled)));
    let anew = rig.gateway_side(1, Duration::from_millis(4), &AXES);
    rig.replace(1, anew);
    let seat = rig.seat(1);
    rig.line.place(seat).judged = false;
    rig.run_ms(300);
    let mut events = rig.at(1).events.clone();
    events.sort_by_key(|(axis, _)| *axis);
    assert_eq!(events, [0, 1, 2].map(|axis| (axis, Event::Fault(Cause::Communication))));
}

/// One character in three hundred or so is wrong at every receiver: frames are lost, and the axes do not notice.
#[test]
fn noise_costs_reports_and_nothing_else() {
    let mut rig = moving(3e-4, 1);
    for round in 0..20 {
        for axis in 0..3 {
            rig.want(1, axis, Control::Follow, 1_100_000 - 10_000 * (round % 5));
        }
        rig.run_ms(100);
    }
    rig.run_ms(1_000);
    let gateway = rig.at(1);
    assert_eq!(gateway.fell, []);
    let statistics = gateway.master.statistics();
    println!("{statistics:?}");
    assert!(
        statistics.missed > 30 && statistics.line.collisions > 30,
        "the line was too kind: {statistics:?}"
    );
    for (address, _) in AXES {
        assert_eq!(rig.of(address).state(), State::Enabled);
        assert!((rig.of(address).position - 1_060_000.0).abs() < 30.0, "{}", rig.of(address).position);
    }
}

/// A stop does not wait for the next cycle, however long that is.
#[test]
fn a_stop_goes_at_once() {
    for control in [Control::Hold, Control::Off] {
        let mut rig = Rig::new(0.0, 1);
        rig.gateway(1, 50, &AXES);
        for (address, form) in AXES {
            rig.module(address, form);
        }
        rig.run_ms(120);
        for axis in 0..3 {
            rig.want(1, axis, Control::Hold, 0);
        }
        rig.run_ms(120);
        for axis in 0..3 {
            rig.want(1, axis, Control::Follow, 1_100_000);
        }
        for pause in [55_000, 61_234, 1_500, 300] {
            rig.want(1, 1, Control::Follow, 1_100_000);
            rig.run(Duration::from_micros(pause + 50_000));
            assert_eq!(rig.of(18).state(), State::Enabled);
            rig.want(1, 1, control, 0);
            // A frame, three answers, the frame that says so.
            rig.run_ms(4);
            let expected = if control == Control::Off { State::Disabled } else { State::Held };
            assert_eq!(rig.of(18).state(), expected, "after {pause}");
            if control == Control::Off {
                break;
            }
        }
    }
}

/// Without an echo every cycle is late, and a client's frame gets its turn all the same: it is told that it did not go.
#[test]
fn a_client_is_not_kept_waiting_by_a_line_that_is_not_there() {
    let line = Settings { baud: 57_600, format: "8N1".parse().expect("a format") };
    let config =
        Config { station: station::Config::new(1, line, frame::MAX_FRAME), cycle: Duration::from_millis(50) };
    let axes = [Axis { address: 17, form: Form::Text }];
    let mut master = Master::<1, 1, 1, { frame::MAX_FRAME }>::new(config, axes, Instant::ZERO, 1);
    let frame = order(9, 17, Control::Observe);
    let (mut now, mut taken) = (Instant::ZERO, false);
    let end = Instant::from_millis(20_000);
    let outcome = loop {
        assert!(now < end, "{} cycles failed", master.statistics().failed);
        match master.poll(now) {
            Action::Posted(outcome) => break outcome,
            Action::Idle => {}
            _ => continue,
        }
        // A client that comes when the line has been down for a while.
        if now > Instant::from_millis(5_000) && !taken {
            taken = master.post(now, &frame).is_ok();
        }
        now = master.poll_at().map_or(end, |at| at.max(now + Duration::from_micros(1)));
    };
    assert_eq!(outcome, Err(Failure::NoEcho));
    assert!(master.statistics().failed > 2);
}
