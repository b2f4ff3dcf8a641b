//! Step responses against a table that scipy computed: tests/peers/step_response/step_response.py.

use puente_cell::table::{Amplifier, AxisProfile};
use puente_drives::pid::Config;

use crate::{Rig, config, smooth};

const TABLE: &str = include_str!("../../../../tests/peers/step_response/step_response.csv");

/// What the simulation may differ from the table by, of the step.
const TOLERANCE: f64 = 0.01;

/// A column of the table: counts at each millisecond.
fn column(name: &str) -> Vec<f64> {
    let mut lines = TABLE.lines().filter(|line| !line.starts_with('#'));
    let header = lines.next().expect("header");
    let at = header.split(',').position(|title| title == name).expect("column");
    let number = |line: &str| line.split(',').nth(at).and_then(|field| field.parse().ok()).expect("number");
    lines.map(number).collect()
}

/// The greatest difference from the table in any millisecond, as a part of the step.
fn difference(name: &str, profile: &AxisProfile, config: Config, gains: [f32; 3], target: i64) -> f64 {
    let expected = column(name);
    assert_eq!(expected.len(), 401);
    let mut rig = Rig::new(profile, config, gains);
    let mut worst: f64 = 0.0;
    for expected in expected {
        let position = rig.axis.plant().position() - 0.5;
        worst = worst.max((position - expected).abs());
        rig.follow(target);
    }
    let worst = worst / target as f64;
    println!("{name}: {:.3} % of the step", worst * 100.0);
    worst
}

#[test]
fn speed_mode_against_the_linear_solution() {
    assert!(difference("speed", &smooth(), config(), [3e-4, 1e-3, 1e-6], 1_000) < TOLERANCE);
}

#[test]
fn current_mode_against_the_linear_solution() {
    let profile = AxisProfile { amplifier: Amplifier::Current { full: 20.0 }, ..smooth() };
    assert!(difference("current", &profile, config(), [5e-4, 5e-3, 1.3e-5], 1_000) < TOLERANCE);
}

#[test]
fn friction_limit_slew_and_anti_windup() {
    let config = Config { limit: 0.2, slew: Some(20.0), ..config() };
    assert!(difference("friction", &AxisProfile::default(), config, [5e-4, 4e-3, 0.0], 500) < TOLERANCE);
}

#[test]
fn a_far_step_at_full_command() {
    let config = Config { slew: Some(100.0), ..config() };
    assert!(difference("far", &AxisProfile::default(), config, [5e-4, 3e-3, 2e-6], 20_000) < TOLERANCE);
}

/// The tolerance tells a wrong loop from a right one.
#[test]
fn other_gains_do_not_pass() {
    for gains in [[3.2e-4, 1e-3, 1e-6], [3e-4, 1.2e-3, 1e-6], [3e-4, 1e-3, 5e-6]] {
        assert!(difference("speed", &smooth(), config(), gains, 1_000) > TOLERANCE, "{gains:?}");
    }
    let config = Config { limit: 0.22, slew: Some(20.0), ..config() };
    assert!(difference("friction", &AxisProfile::default(), config, [5e-4, 4e-3, 0.0], 500) > TOLERANCE);
}
