//! Moves of axes and of the table.

use std::time::Duration;

use puente_cell::table::{Amplifier, Axis, AxisProfile, Table};
use puente_drives::pid::{Command, Config, Encoder, Event, Gains, State, Width};
use puente_line::Instant;

use crate::{Rig, config};

/// As the thesis tells of its table: "small changes of movement did not happen, only those that need more power".
#[test]
fn small_moves_stick_without_an_integral() {
    let mut rig = Rig::new(&AxisProfile::default(), config(), [5e-4, 0.0, 0.0]);
    rig.milliseconds(500, 10);
    assert_eq!(rig.status().position, 0);
    rig.milliseconds(500, 1_000);
    let left = 1_000 - rig.status().position;
    assert!((1..=15).contains(&left), "{left}");
    let mut rig = Rig::new(&AxisProfile::default(), config(), [5e-4, 5e-3, 0.0]);
    rig.milliseconds(2_000, 10);
    assert!((rig.status().position - 10).abs() <= 3, "{}", rig.status().position);
}

#[test]
fn an_integral_carries_a_load() {
    let position = |ki| {
        let mut rig = Rig::new(&AxisProfile::default(), config(), [5e-4, ki, 0.0]);
        rig.milliseconds(200, 0);
        rig.axis.plant_mut().set_load(0.1);
        rig.milliseconds(1_500, 0);
        rig.status().position
    };
    assert!(position(0.0) < -20, "{}", position(0.0));
    assert!(position(5e-3).abs() < 15, "{}", position(5e-3));
}

#[test]
fn set_points_at_a_speed_keep_the_following_error_small() {
    let config = Config { speed: Some(50_000), following_error: 2_000, ..config() };
    let mut rig = Rig::new(&AxisProfile::default(), config, [5e-4, 0.0, 0.0]);
    rig.milliseconds(1_500, 50_000);
    let status = rig.status();
    assert_eq!((status.state, status.reference), (State::Enabled, 50_000));
    assert!((status.position - 50_000).abs() <= 15, "{}", status.position);
}

#[test]
fn a_stop_in_full_motion_ends_where_it_was_given() {
    let config = Config { speed: Some(50_000), ..config() };
    let mut rig = Rig::new(&AxisProfile::default(), config, [5e-4, 0.0, 0.0]);
    rig.milliseconds(500, 50_000);
    assert!(rig.status().velocity > 45_000.0);
    let place = rig.status().position;
    rig.axis.command(Command::Stop).expect("stop");
    rig.milliseconds(1_000, 50_000);
    let status = rig.status();
    assert_eq!(status.state, State::Held);
    assert!((status.position - place).abs() <= 15, "{} {place}", status.position);
    assert_eq!(rig.axis.plant().velocity(), 0.0);
}

#[test]
fn an_axis_that_is_enabled_in_motion_does_not_jump() {
    let mut rig = Rig::new(&AxisProfile::default(), config(), [5e-4, 0.0, 0.0]);
    rig.milliseconds(100, 20_000);
    rig.axis.command(Command::Disable).expect("disable");
    for _ in 0..20 {
        rig.pass();
    }
    assert!(rig.axis.plant().velocity() > 1_000.0, "it coasts");
    rig.axis.command(Command::Enable).expect("enable");
    rig.axis.advance(rig.now + Duration::from_micros(100), |_, _| {});
    let status = rig.status();
    assert_eq!((status.state, status.command), (State::Enabled, 0.0));
    assert_eq!(status.set_point, status.position);
}

/// Every kind of encoder shows the same motion; the narrow one passes its end many times.
#[test]
fn encoders_are_alike() {
    let width = |bits| Width::new(bits).expect("width");
    let run = |encoder| {
        let config = Config { encoder, ..config() };
        let mut rig = Rig::new(&AxisProfile::default(), config, [5e-4, 1e-3, 1e-6]);
        rig.milliseconds(1_000, 30_000);
        rig.milliseconds(1_000, -30_000);
        (rig.status().position, rig.axis.plant().position())
    };
    let timer = run(Encoder::Binary(Width::W16));
    assert!(timer.0 < -29_000, "{timer:?}");
    assert_eq!(timer, run(Encoder::Binary(Width::W32)));
    assert_eq!(timer, run(Encoder::Gray(width(12))));
    assert_eq!(timer, run(Encoder::Gray(width(32))));
}

fn gains(kp: f32, ki: f32, kd: f32) -> Command {
    Command::Gains(Gains::new(kp, ki, kd).expect("gains"))
}

#[test]
fn three_axes_move_apart_and_the_same_on_every_run() {
    let run = || {
        let config = Config { speed: Some(40_000), ..Config::new(Encoder::Binary(Width::W16)) };
        let mut table = Table::new(&AxisProfile::default(), config).expect("config");
        let mut events = Vec::new();
        let targets = [5_000, -12_000, 20_000];
        for millisecond in 1..=1_500 {
            for (axis, target) in table.axes_mut().iter_mut().zip(targets) {
                match millisecond {
                    2 => axis.command(gains(5e-4, 1e-3, 0.0)).expect("gains"),
                    3 => axis.command(Command::Enable).expect("enable"),
                    _ => {
                        let _ = axis.command(Command::SetPoint(target));
                    }
                }
            }
            table
                .advance(Instant::from_millis(millisecond), |axis, at, event| events.push((axis, at, event)));
        }
        let statuses = table.axes().each_ref().map(|axis: &Axis| axis.module().status());
        for (status, target) in statuses.iter().zip(targets) {
            assert_eq!(status.state, State::Enabled);
            assert!((status.position - target).abs() < 100, "{} {target}", status.position);
        }
        // Enabled at 2 ms, and 20 ms for the amplifier.
        let enabled = (0..3).map(|axis| (axis, Instant::from_millis(22), Event::Enabled));
        assert_eq!(events, enabled.collect::<Vec<_>>());
        statuses
    };
    assert_eq!(run(), run());
}

#[test]
fn current_mode_needs_a_derivative() {
    let profile = AxisProfile { amplifier: Amplifier::Current { full: 20.0 }, ..AxisProfile::default() };
    let greatest = |kd| {
        let mut rig = Rig::new(&profile, config(), [5e-4, 0.0, kd]);
        (0..500).map(|_| (rig.follow(1_000), rig.status().position).1).max()
    };
    assert!(greatest(0.0) > Some(1_500), "{:?}", greatest(0.0));
    assert!(greatest(2e-5) < Some(1_050), "{:?}", greatest(2e-5));
}
