//! What goes wrong, and how it ends.

use puente_drives::pid::{Cause, EncoderFault, Event, State};
use puente_framed::{Kind, frame};
use puente_line::Instant;
use puente_modules::Control;

use crate::{Rig, config, order};

/// 17 and 18 on their way to far places.
fn moving() -> Rig {
    let mut rig = Rig::new(config());
    rig.enable(&[17, 18]);
    rig.want(&[17, 18], order(Control::Follow, 60_000));
    rig.milliseconds(300);
    assert!([17, 18].iter().all(|address| rig.velocity(*address) > 45_000.0));
    rig.events.clear();
    rig
}

fn disturb(rig: &mut Rig, words: &str) {
    assert!(rig.cell.disturb(Instant::ZERO, words.parse().expect("words")), "{words}");
}

/// 17 has stopped for this cause and has told so, and 18 is where it was sent.
fn ends(mut rig: Rig, cause: Cause) -> Rig {
    rig.milliseconds(1_500);
    assert_eq!((rig.state(17), rig.velocity(17)), (State::Fault(cause), 0.0));
    assert!(rig.position(17) < 59_000.0);
    assert_eq!(rig.events, [(17, Event::Fault(cause))]);
    assert_eq!(rig.state(18), State::Enabled);
    assert!((rig.position(18) - 60_000.0).abs() < 20.0, "{}", rig.position(18));
    rig
}

#[test]
fn a_commander_that_is_gone_stops_its_axes() {
    let mut rig = moving();
    rig.dead = true;
    rig.milliseconds(102);
    let places = [17, 18].map(|address| rig.position(address));
    for address in [17, 18] {
        assert_eq!(rig.state(address), State::Fault(Cause::Communication));
    }
    rig.milliseconds(1_000);
    for (address, place) in [17, 18].into_iter().zip(places) {
        assert_eq!(rig.velocity(address), 0.0);
        assert!(
            rig.position(address) - place < 15_000.0,
            "friction alone: {}",
            rig.position(address) - place
        );
    }
}

#[test]
fn an_encoder_that_is_lost() {
    let mut rig = moving();
    disturb(&mut rig, "17 encoder lost");
    let mut rig = ends(rig, Cause::Encoder(EncoderFault::Line));
    disturb(&mut rig, "17 encoder sound");
    rig.want(&[17], order(Control::Off, 0));
    rig.milliseconds(10);
    assert_eq!(rig.state(17), State::Disabled);
}

#[test]
fn an_encoder_that_came_loose() {
    let mut rig = moving();
    disturb(&mut rig, "17 encoder frozen");
    ends(rig, Cause::FollowingError);
}

#[test]
fn an_amplifier_that_trips() {
    let mut rig = moving();
    disturb(&mut rig, "17 amplifier fault");
    ends(rig, Cause::Amplifier);
}

#[test]
fn a_deaf_module_stops() {
    let mut rig = moving();
    disturb(&mut rig, "17 deaf on");
    rig.milliseconds(1_000);
    assert_eq!((rig.state(17), rig.velocity(17)), (State::Fault(Cause::Communication), 0.0));
    assert_eq!(rig.state(18), State::Enabled, "it is not disturbed");
}

#[test]
fn a_mute_module_obeys() {
    let mut rig = moving();
    disturb(&mut rig, "17 mute on");
    rig.milliseconds(10);
    rig.reports.clear();
    rig.milliseconds(1_000);
    assert!(rig.reports.iter().all(|(from, _)| *from == 18));
    assert_eq!(rig.state(17), State::Enabled);
    assert!((rig.position(17) - 60_000.0).abs() < 20.0);
    disturb(&mut rig, "17 mute off");
    rig.milliseconds(50);
    assert_eq!(rig.report(17).state, State::Enabled);
}

#[test]
fn a_module_that_is_switched_off_forgets_all() {
    let mut rig = moving();
    disturb(&mut rig, "17 power-cycle");
    let place = rig.position(17);
    rig.milliseconds(1_500);
    let status = rig.cell.module(17).expect("a module").status();
    assert_eq!(status.state, State::Disabled, "a Follow that goes on does not enable it");
    assert_eq!(rig.velocity(17), 0.0);
    let counted = rig.position(17) - place;
    assert!((status.position as f64 - counted).abs() <= 1.5, "{} {counted}", status.position);
    assert!((rig.position(18) - 60_000.0).abs() < 20.0);
    rig.want(&[17], order(Control::Hold, 0));
    rig.milliseconds(100);
    assert_eq!(rig.state(17), State::Disabled, "nor does a Hold without an edge");
    rig.enable(&[17]);
}

#[test]
fn what_a_station_cannot_have_is_refused() {
    let mut rig = Rig::new(puente_cell::framed::Config { rivals: 1, ..config() });
    for (words, possible) in
        [("17 deaf on", true), ("201 deaf on", true), ("201 encoder lost", false), ("20 deaf on", false)]
    {
        let disturbance = words.parse().expect("words");
        assert_eq!(rig.cell.disturb(Instant::ZERO, disturbance), possible, "{words}");
    }
}

/// A frame of the thesis from outside, byte by byte and late, gives a module its gains and is acknowledged.
#[test]
fn a_frame_of_the_thesis_is_answered() {
    let mut rig = Rig::new(config());
    let setting = puente_modules::Setting { order: None, ..order(Control::Hold, 0) };
    let data = setting.emit(rig.form).expect("text");
    let mut body = heapless::Vec::<u8, 64>::new();
    puente_framed::section::push(&mut body, 17, &data).expect("room");
    let mut bytes = heapless::Vec::<u8, 80>::new();
    frame::emit(&mut bytes, 1, Kind::Plain, &body).expect("a frame");
    let mut now = 1_000;
    for byte in &bytes {
        rig.cell.receive(0, Instant::from_micros(now), &[*byte]);
        now += 11;
    }
    let heard = rig.cell.poll(0, Instant::from_micros(now + 2_000)).expect("an answer");
    let answer = frame::parse(&heard[bytes.len()..]).expect("a frame");
    assert_eq!((answer.origin, answer.kind), (17, Kind::Receipt { lrc: bytes[bytes.len() - 2] }));
}
