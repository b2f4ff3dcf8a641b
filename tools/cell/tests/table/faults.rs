//! What goes wrong on an axis in motion, and how it ends: no current, an event, and the axis at rest by friction.

use std::time::Duration;

use puente_cell::table::{AxisProfile, Feedback};
use puente_drives::pid::{Cause, Command, Config, EncoderFault, Event, State};
use puente_line::Instant;

use crate::{Rig, config};

/// In motion at 50 000 counts a second for half a second.
fn moving() -> Rig {
    let config = Config { speed: Some(50_000), following_error: 2_000, ..config() };
    let mut rig = Rig::new(&AxisProfile::default(), config, [5e-4, 1e-3, 0.0]);
    rig.milliseconds(500, 80_000);
    assert!(rig.status().velocity > 45_000.0);
    rig.events.clear();
    rig
}

/// Asserts that the fault came within `time`, once, and that the axis comes to rest for good.
fn ends(mut rig: Rig, since: Instant, time: Duration, cause: Cause) {
    assert_eq!(rig.status().state, State::Fault(cause));
    let [(at, event)] = rig.events[..] else { panic!("{:?}", rig.events) };
    assert_eq!(event, Event::Fault(cause));
    assert!(at.since(since) <= time, "{:?}", at.since(since));
    rig.pass();
    assert_eq!(rig.axis.plant().current(), 0.0);
    rig.milliseconds(2_000, 80_000);
    assert_eq!(rig.axis.plant().velocity(), 0.0);
    assert_eq!(rig.events.len(), 1);
}

#[test]
fn communication_is_lost() {
    let mut rig = moving();
    let since = rig.now;
    for _ in 0..110 {
        rig.pass();
    }
    ends(rig, since, Duration::from_micros(100_100), Cause::Communication);
}

#[test]
fn the_encoder_is_lost() {
    let mut rig = moving();
    rig.axis.set_feedback(Feedback::Lost(EncoderFault::Line));
    let since = rig.now;
    rig.milliseconds(2, 80_000);
    ends(rig, since, Duration::ZERO, Cause::Encoder(EncoderFault::Line));
}

#[test]
fn the_encoder_jumps() {
    let mut rig = moving();
    let turn = rig.status().position as u32 + 2_000;
    rig.axis.set_feedback(Feedback::Frozen(turn & 0xFFFF));
    let since = rig.now;
    rig.milliseconds(2, 80_000);
    ends(rig, since, Duration::ZERO, Cause::Encoder(EncoderFault::Jump));
}

#[test]
fn the_encoder_comes_loose() {
    let mut rig = moving();
    rig.axis.freeze_encoder();
    let since = rig.now;
    rig.milliseconds(150, 80_000);
    // 2000 counts are 40 ms of this speed; it was behind already. And 50 ms more.
    ends(rig, since, Duration::from_millis(91), Cause::FollowingError);
}

#[test]
fn the_axis_runs_against_its_end_stop() {
    let profile = AxisProfile { travel: (-1_000, 30_000), ..AxisProfile::default() };
    let config = Config { speed: Some(50_000), following_error: 2_000, ..config() };
    let mut rig = Rig::new(&profile, config, [5e-4, 1e-3, 0.0]);
    rig.events.clear();
    let since = rig.now;
    rig.milliseconds(1_000, 80_000);
    assert_eq!(rig.status().position, 30_000);
    // 600 ms to the stop, and as above.
    ends(rig, since, Duration::from_millis(700), Cause::FollowingError);
}

#[test]
fn the_amplifier_trips_and_is_brought_back() {
    let mut rig = moving();
    rig.axis.plant_mut().set_fault(true);
    let since = rig.now;
    rig.milliseconds(2, 80_000);
    ends(rig, since, Duration::from_micros(100), Cause::Amplifier);
    let mut rig = moving();
    rig.axis.plant_mut().set_fault(true);
    rig.milliseconds(500, 80_000);
    rig.axis.plant_mut().set_fault(false);
    rig.milliseconds(500, 80_000);
    assert!(rig.axis.plant().fault(), "stored");
    rig.axis.command(Command::Disable).expect("disable");
    rig.enable();
    // Without its time to start the module sees the stored fault at once; with it, the fault is gone.
    assert_eq!(rig.status().state, State::Fault(Cause::Amplifier));
    let config = Config { start: Duration::from_millis(5), ..config() };
    let mut rig = Rig::new(&AxisProfile::default(), config, [5e-4, 1e-3, 0.0]);
    rig.milliseconds(10, 0);
    rig.axis.plant_mut().set_fault(true);
    rig.milliseconds(2, 0);
    rig.axis.plant_mut().set_fault(false);
    rig.axis.command(Command::Disable).expect("disable");
    rig.enable();
    rig.milliseconds(10, 0);
    assert_eq!(rig.status().state, State::Enabled);
}

#[test]
fn a_wrong_sense_ends_soon() {
    // The axis is pushed by hand a little: positive feedback does the rest.
    let config = Config { reversed: true, following_error: 2_000, ..config() };
    let mut rig = Rig::new(&AxisProfile::default(), config, [5e-4, 0.0, 0.0]);
    rig.events.clear();
    let since = rig.now;
    rig.milliseconds(500, 100);
    ends(rig, since, Duration::from_millis(300), Cause::FollowingError);
}
