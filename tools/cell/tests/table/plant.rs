//! The plant alone, against what can be worked out by hand.

use std::f64::consts::{PI, TAU};

use puente_cell::table::{Amplifier, AxisProfile, Plant};
use puente_drives::pid::{Edge, Quadrature};

use crate::smooth;

/// Steps for so long.
fn run(plant: &mut Plant, milliseconds: u32, command: f64) {
    for _ in 0..milliseconds * 100 {
        plant.step(command, true);
    }
}

fn torque_mode() -> AxisProfile {
    AxisProfile { amplifier: Amplifier::Current { full: 10.0 }, ..AxisProfile::default() }
}

#[test]
fn current_follows_with_its_time_constant() {
    let mut plant = Plant::new(&torque_mode());
    for _ in 0..20 {
        plant.step(0.5, true);
    }
    assert!((plant.current() - 5.0 * (1.0 - (-1.0_f64).exp())).abs() < 0.01, "{}", plant.current());
    run(&mut plant, 2, 0.5);
    assert!((plant.current() - 5.0).abs() < 0.01);
}

#[test]
fn torque_accelerates_the_inertia() {
    let mut profile = torque_mode();
    profile.motor.viscous = 0.0;
    let mut plant = Plant::new(&profile);
    run(&mut plant, 10, 0.1);
    let before = plant.velocity();
    run(&mut plant, 20, 0.1);
    // (0.06 N·m/A 1 A - 0.02 N·m) / 5e-5 kg·m² is 800 rad/s².
    let expected = 800.0 * 0.02 / TAU * 2_000.0;
    assert!((plant.velocity() - before - expected).abs() < 1e-6 * expected);
}

#[test]
fn speed_mode_reaches_its_speed_less_what_friction_takes() {
    let mut plant = Plant::new(&AxisProfile::default());
    run(&mut plant, 200, 0.5);
    // 50 pi rad/s less e, where gain e constant = coulomb + viscous (50 pi - e).
    let droop = (0.02 + 2e-5 * 50.0 * PI) / (0.15 * 0.06 + 2e-5);
    let expected = (50.0 * PI - droop) / TAU * 2_000.0;
    assert!((plant.velocity() - expected).abs() < 1.0, "{} {expected}", plant.velocity());
}

#[test]
fn current_and_supply_are_limited() {
    let mut plant = Plant::new(&AxisProfile::default());
    run(&mut plant, 2, 1.0);
    assert!((plant.current() - 20.0).abs() < 0.01, "47 A are asked for: {}", plant.current());
    // 12 V drive no faster than 200 rad/s.
    let mut plant = Plant::new(&AxisProfile { supply: 12.0, ..smooth() });
    run(&mut plant, 500, 1.0);
    let speed = plant.velocity() / 2_000.0 * TAU;
    assert!((190.0..200.0).contains(&speed), "{speed}");
}

#[test]
fn dry_friction_holds_and_stops() {
    let mut plant = Plant::new(&torque_mode());
    run(&mut plant, 100, 0.033); // 0.0198 N·m
    assert_eq!((plant.velocity(), plant.counts()), (0.0, 0));
    run(&mut plant, 100, 0.034);
    assert!(plant.velocity() > 0.0);
    run(&mut plant, 50, 0.2);
    run(&mut plant, 2_000, 0.0);
    assert_eq!(plant.velocity(), 0.0, "it comes to rest and stays");
    let position = plant.position();
    run(&mut plant, 100, -0.03);
    assert_eq!(plant.position(), position);
}

#[test]
fn without_the_enable_line_the_axis_coasts() {
    let mut plant = Plant::new(&smooth());
    run(&mut plant, 100, 0.5);
    let before = plant.velocity();
    for _ in 0..10_000 {
        plant.step(0.5, false);
    }
    // Viscous friction alone: inertia / viscous is 2.5 s.
    let expected = before * (-0.1_f64 / 2.5).exp();
    assert!((plant.velocity() - expected).abs() < 1.0);
    assert_eq!(plant.current(), 0.0);
}

#[test]
fn a_load_moves_an_axis_that_is_not_held() {
    let mut plant = Plant::new(&AxisProfile::default());
    plant.set_load(0.01);
    run(&mut plant, 100, 0.0);
    assert_eq!(plant.velocity(), 0.0, "friction holds it");
    plant.set_load(0.05);
    for _ in 0..1_000 {
        plant.step(0.0, false);
    }
    assert!(plant.velocity() < 0.0);
}

#[test]
fn end_stops() {
    let mut plant = Plant::new(&AxisProfile { travel: (-500, 1_000), ..AxisProfile::default() });
    for (command, end) in [(0.3, 1_000.0), (-0.3, -500.0), (0.3, 1_000.0)] {
        run(&mut plant, 500, command);
        assert!((plant.position() - end).abs() < 1e-6, "{}", plant.position());
        assert_eq!(plant.velocity(), 0.0);
    }
    run(&mut plant, 10, -0.3);
    assert!(plant.velocity() < 0.0, "it comes off");
}

#[test]
fn tracks_tell_the_same_as_counts() {
    let mut plant = Plant::new(&AxisProfile::default());
    let (a, b) = plant.tracks();
    let mut counter = Quadrature::new(a, b);
    for step in 0..60_000 {
        plant.step(if step < 25_000 { 0.5 } else { -0.5 }, true);
        let (a, b) = plant.tracks();
        assert_ne!(counter.sample(a, b), Edge::Missed, "0.5 counts a step");
        assert_eq!(counter.position(), plant.counts());
    }
    assert!(plant.counts() < -1_000, "both ways: {}", plant.counts());
}

#[test]
fn the_amplifier_stores_a_fault() {
    let mut plant = Plant::new(&AxisProfile::default());
    run(&mut plant, 10, 0.1);
    plant.set_fault(true);
    run(&mut plant, 1, 0.1);
    assert!(plant.fault() && plant.current() == 0.0);
    plant.set_fault(false);
    run(&mut plant, 10, 0.1);
    assert!(plant.fault(), "until it is enabled anew");
    plant.step(0.1, false);
    assert!(plant.fault());
    run(&mut plant, 1, 0.1);
    assert!(!plant.fault() && plant.current() > 0.0);
}
