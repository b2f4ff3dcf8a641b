//! Others on the line: rivals, a babbler, stations outside.

use std::time::Duration;

use puente_cell::framed::{Cell, Config, FIRST_RIVAL};
use puente_drives::pid::State;
use puente_framed::Decoder;
use puente_framed::arbiter::Echo;
use puente_framed::frame::MAX_FRAME;
use puente_line::Instant;
use puente_modules::Control;

use crate::{Rig, config, line, order};

fn disturb(rig: &mut Rig, words: &str) {
    assert!(rig.cell.disturb(Instant::ZERO, words.parse().expect("words")), "{words}");
}

#[test]
fn rivals_offer_what_they_shall() {
    for (load, expected) in [(0.0, 0.0..=0.0), (0.2, 0.17..=0.23), (0.5, 0.45..=0.55), (4.0, 0.75..=1.0)] {
        let mut cell = Cell::new(Config { rivals: 4, load, ..config() }).expect("a cell");
        let time = Duration::from_secs(2);
        cell.run(Instant::ZERO + time);
        let carried = cell.totals().bits as f64 / (time.as_secs_f64() * f64::from(line().baud));
        assert!(expected.contains(&carried), "{load}: {carried}");
    }
}

#[test]
fn rivals_talk_to_each_other_alone() {
    let mut cell = Cell::new(Config { rivals: 2, load: 0.2, ..config() }).expect("a cell");
    let mut decoder = Box::new(Decoder::<MAX_FRAME>::new());
    cell.poll(0, Instant::from_millis(500)).expect("something").iter().for_each(|byte| decoder.push(*byte));
    let mut origins = Vec::new();
    while decoder.advance() {
        let frame = decoder.frame().expect("a frame");
        assert_eq!(frame.section_for(17), None);
        origins.push(frame.origin);
    }
    origins.sort_unstable();
    origins.dedup();
    assert_eq!(origins, [FIRST_RIVAL, FIRST_RIVAL + 1]);
}

/// Three axes arrive on a line with rivals and noise, and nothing trips.
#[test]
fn axes_arrive_among_rivals_and_noise() {
    let mut rig = Rig::new(Config { rivals: 3, load: 0.3, noise: 1e-5, ..config() });
    rig.enable(&[17, 18, 19]);
    rig.want(&[17, 18, 19], order(Control::Follow, 4_000));
    rig.milliseconds(1_000);
    for address in [17, 18, 19] {
        assert_eq!(rig.state(address), State::Enabled);
        assert!((rig.position(address) - 4_000.0).abs() < 20.0);
    }
    let statistics = rig.statistics();
    assert!(statistics.collisions > 0 && statistics.losses == 0, "{statistics:?}");
}

#[test]
fn a_babbler_holds_the_line_for_its_time() {
    let mut rig = Rig::new(config());
    rig.enable(&[17]);
    disturb(&mut rig, "babble 60");
    rig.milliseconds(50);
    rig.reports.clear();
    rig.milliseconds(5);
    assert_eq!(rig.reports, [], "nobody gets through");
    assert_eq!(rig.state(17), State::Held, "it has waited before");
    rig.milliseconds(40);
    assert!(rig.reports.len() > 5, "{}", rig.reports.len());
    assert_eq!(rig.state(17), State::Held);
    disturb(&mut rig, "babble 200");
    rig.milliseconds(150);
    assert!(matches!(rig.state(17), State::Fault(_)), "{}", rig.state(17));
}

#[test]
fn stations_outside_hear_each_other_and_themselves() {
    let heard = |echo| {
        let mut cell = Cell::new(Config { ports: 3, echo, ..config() }).expect("a cell");
        cell.receive(1, Instant::from_micros(100), b"abc");
        [0, 1, 2].map(|port| cell.poll(port, Instant::from_millis(1)).unwrap_or_default())
    };
    assert_eq!(heard(true), [b"abc"; 3]);
    assert_eq!(heard(false), [&b"abc"[..], b"", b"abc"]);
}

/// The settings of a gateway that does not hear itself are its own.
#[test]
fn modules_hear_themselves_where_those_outside_do_not() {
    let mut config = config();
    (config.echo, config.manners.echo) = (false, Echo::None);
    let mut rig = Rig::new(config);
    rig.enable(&[17, 18, 19]);
    disturb(&mut rig, "17 mute on");
    rig.milliseconds(100);
    let attempts = rig.cell.module(17).expect("a module").statistics();
    assert!(attempts.losses > 0, "it does not hear itself any more: {attempts:?}");
}

#[test]
fn what_is_dropped_is_not_on_the_line() {
    let mut cell = Cell::new(Config { ports: 2, ..config() }).expect("a cell");
    cell.receive(0, Instant::from_micros(100), b"abcdef");
    assert!(!cell.carrier(1, Instant::from_micros(100)) && cell.carrier(1, Instant::from_micros(115)));
    cell.discard(0, Instant::from_micros(124));
    cell.receive(0, Instant::from_micros(124), b"X");
    let heard = cell.poll(1, Instant::from_millis(1)).expect("something");
    assert!(heard == b"abX" || heard == b"abcX", "{heard:?}");
}

#[test]
fn a_flood_from_outside_is_bounded() {
    let mut cell = Cell::new(config()).expect("a cell");
    for _ in 0..20 {
        cell.receive(0, Instant::ZERO, &[0x55; 10_000]);
    }
    let heard = cell.poll(0, Instant::from_millis(10_000)).expect("something").len();
    assert!((65_536..=65_600).contains(&heard), "{heard}");
    assert_eq!(cell.poll(7, Instant::from_millis(10_000)), None, "there is no such port");
}
