//! Every mode.

use std::time::Duration;

use puente_canopen::NodeId;
use puente_cell::can::Model;
use puente_drives::cia402::homing::Method;
use puente_drives::cia402::{Mode, Profile};
use puente_servos::{Axis, Motion, Order};

use crate::rig::Rig;

const DRIVES: [(Model, &Profile); 2] =
    [(Model::Lexium23a, &Profile::LEXIUM_23A), (Model::FestoCmms, &Profile::FESTO_CMMS)];

fn to(target: i32, serial: u32) -> Order {
    Order::Move(Motion::Position { target, velocity: None, relative: false, serial })
}

fn near(is: f64, should: f64) {
    assert!((is - should).abs() < 100.0, "{is} instead of {should}");
}

#[test]
fn a_drive_goes_through_all_its_modes() {
    for (model, profile) in DRIVES {
        let mut rig = Rig::new(&[Axis::new(NodeId::MIN, profile)], model, Duration::ZERO);
        let here = rig.position(1);
        rig.reach(0, Order::Hold);
        rig.run_ms(100);
        near(rig.position(1), here);
        rig.reach(0, Order::Move(Motion::Home { method: Method::new(35), serial: 1 }));
        assert!(rig.report(0).homed);
        near(rig.position(1), 0.0);
        rig.reach(0, to(5_000, 1));
        near(rig.position(1), 5_000.0);
        rig.reach(0, to(-2_000, 2));
        near(rig.position(1), -2_000.0);
        rig.reach(0, Order::Move(Motion::Velocity(10_000)));
        assert!(rig.velocity(1) > 1_000.0);
        rig.reach(0, Order::Hold);
        let here = rig.position(1);
        rig.run_ms(200);
        near(rig.position(1), here);
        rig.reach(
            0,
            Order::Move(Motion::Position { target: 500, velocity: None, relative: true, serial: 3 }),
        );
        near(rig.position(1), here + 500.0);
        // Half way, to another place.
        rig.set(0, to(1_000_000, 4));
        rig.run_ms(300);
        rig.reach(0, to(3_000, 5));
        near(rig.position(1), 3_000.0);
        rig.set(0, Order::Move(Motion::Torque(200)));
        rig.run_ms(300);
        assert!(rig.velocity(1).abs() > 0.0);
        rig.reach(0, Order::Stop);
        rig.reach(0, Order::Hold);
        rig.reach(0, Order::Off);
        assert_eq!(rig.fell, []);
    }
}

#[test]
fn a_drive_finds_its_switch() {
    let mut rig = Rig::new(&[Axis::new(NodeId::MIN, &Profile::LEXIUM_23A)], Model::Lexium23a, Duration::ZERO);
    rig.reach(0, Order::Move(Motion::Home { method: Method::new(17), serial: 1 }));
    assert!(rig.report(0).homed);
    rig.reach(0, to(10_000, 1));
}

#[test]
fn interpolated_positions_are_followed() {
    for (model, profile) in DRIVES {
        let axis = Axis { cyclic: Some(Mode::InterpolatedPosition), ..Axis::new(NodeId::MIN, profile) };
        let mut rig = Rig::new(&[axis], model, Duration::from_millis(1));
        rig.reach(0, Order::Hold);
        let here = rig.report(0).position.expect("a position");
        rig.reach(0, Order::Move(Motion::Interpolate(here)));
        for step in 1..=500 {
            rig.set(0, Order::Move(Motion::Interpolate(here + 10 * step)));
            rig.run_ms(1);
        }
        rig.run_ms(50);
        near(rig.position(1), f64::from(here + 5_000));
        rig.reach(0, Order::Hold);
        rig.run_ms(100);
        near(rig.position(1), f64::from(here + 5_000));
        rig.reach(0, to(here, 1));
        near(rig.position(1), f64::from(here));
        assert_eq!(rig.fell, []);
    }
}

/// From its set-points' first to their last nothing jumps: what is told is as fast as the drive is set to, and no faster.
#[test]
fn a_move_is_made_of_set_points() {
    for (model, profile) in DRIVES {
        let axis = Axis { cyclic: Some(Mode::InterpolatedPosition), ..Axis::new(NodeId::MIN, profile) };
        let mut rig = Rig::new(&[axis], model, Duration::from_millis(1));
        rig.reach(0, Order::Hold);
        assert_eq!(rig.report(0).mode, Some(Mode::InterpolatedPosition), "it waits where it is to move");
        let here = rig.report(0).position.expect("a position");
        let go = |target, velocity, serial| {
            Order::Move(Motion::Position { target, velocity, relative: false, serial })
        };
        rig.watch();
        rig.reach(0, go(here + 200_000, Some(400_000), 1));
        near(rig.position(1), f64::from(here + 200_000));
        // 10 000 000 units/s² as delivered, for 1 ms.
        let seen = rig.watched();
        assert_eq!(seen.first(), Some(&here));
        assert!(rig.fastest(&seen) <= 400 && rig.hardest(&seen) <= 11, "{seen:?}");
        let moved = seen.iter().filter(|position| **position != here && **position != here + 200_000).count();
        // 0.2 Mu at 0.4 Mu/s, and 40 ms at half of that up and down.
        assert!((535..=545).contains(&moved), "{moved}");
        // Back, and to another place on the way; then it is let stand there.
        rig.watch();
        rig.set(0, go(here, None, 2));
        rig.run_ms(100);
        rig.set(0, go(here + 300_000, None, 3));
        rig.run_ms(250);
        rig.reach(0, Order::Hold);
        let seen = rig.watched();
        let stands = *seen.last().expect("set-points");
        assert!(rig.fastest(&seen) <= 1_000 && rig.hardest(&seen) <= 11, "{seen:?}");
        assert!((here + 1_000..here + 299_000).contains(&stands), "{stands}");
        near(rig.position(1), f64::from(stands));
        rig.reach(
            0,
            Order::Move(Motion::Position { target: 500, velocity: None, relative: true, serial: 4 }),
        );
        near(rig.position(1), f64::from(stands + 500));
        // What it is to be otherwise, it is.
        rig.reach(0, Order::Move(Motion::Velocity(10_000)));
        rig.reach(0, go(here, None, 5));
        rig.set(0, go(here + 1_000_000, None, 6));
        rig.run_ms(200);
        rig.reach(0, Order::Stop);
        rig.run_ms(500);
        assert!(rig.velocity(1) == 0.0 && rig.position(1) < f64::from(here + 300_000));
        assert_eq!(rig.fell, []);
    }
}
