//! Motion.

use std::time::Duration;

use puente_drives::cia402::homing::Method;
use puente_drives::cia402::{Mode, Profile};
use puente_servos::{Failure, Motion, Order, Progress};

use crate::rig::{Rig, axis};

fn rig() -> Rig {
    Rig::new(&[axis(2, &Profile::LEXIUM_23A)], Duration::ZERO).boot()
}

fn to(target: i32, serial: u32) -> Order {
    Order::Move(Motion::Position { target, velocity: None, relative: false, serial })
}

/// Thesis, 6.4.1 to 6.4.3: the words by PDO, modes by RPDO 2, targets by RPDO 3, and bit 4 after that by RPDO 1.
#[test]
fn frames_are_those_of_the_thesis() {
    let mut rig = rig();
    rig.reach(0, Order::Hold);
    let words = rig.told(0x202);
    assert_eq!(words, [[0x06, 0], [0x07, 0], [0x0F, 0]]);
    rig.sent.clear();
    rig.reach(0, Order::Move(Motion::Home { method: None, serial: 1 }));
    assert!(rig.report(0).homed);
    assert_eq!(rig.told(0x302), [[0x0F, 0, 0x06]]);
    assert_eq!(rig.told(0x202), [[0x1F, 0], [0x0F, 0]], "homing begins, and bit 4 falls when it is over");
    rig.sent.clear();
    rig.reach(0, to(0x0000_0230, 1));
    assert_eq!(rig.told(0x302), [[0x0F, 0, 0x01]]);
    assert_eq!(rig.told(0x402), [[0x0F, 0, 0x30, 0x02, 0, 0]]);
    assert_eq!(rig.told(0x202), [[0x1F, 0], [0x0F, 0]]);
    assert_eq!(rig.devices[0].position(), 0x230);
    rig.sent.clear();
    rig.reach(0, to(0x0000_0130, 2));
    assert_eq!(rig.told(0x402), [[0x0F, 0, 0x30, 0x01, 0, 0]]);
    assert_eq!(rig.told(0x202), [[0x1F, 0], [0x0F, 0]]);
    assert_eq!(rig.devices[0].position(), 0x130);
    rig.sent.clear();
    rig.reach(0, Order::Off);
    assert!(!rig.devices[0].is_enabled());
}

/// What was in the drive before must not count: it is where it stands, before it is under current.
#[test]
fn enabling_does_not_jump() {
    let mut rig = rig();
    rig.devices[0].put(0x6064, 0, 123_456);
    rig.devices[0].put(0x607A, 0, -5);
    rig.reach(0, Order::Hold);
    assert_eq!(rig.devices[0].get(0x607A, 0), 123_456);
    rig.run_ms(200);
    assert_eq!(rig.devices[0].position(), 123_456);
    // In velocity, too.
    rig.reach(0, Order::Off);
    rig.devices[0].put(0x60FF, 0, 30);
    rig.reach(0, Order::Move(Motion::Mode(Mode::ProfileVelocity)));
    rig.run_ms(100);
    assert_eq!(rig.devices[0].position(), 123_456);
}

#[test]
fn a_position_is_reached_and_another_replaces_it() {
    let mut rig = rig();
    rig.set(0, to(5_000, 1));
    rig.run_ms(100);
    assert_eq!(rig.progress(0), Progress::Running);
    let here = rig.devices[0].position();
    assert!((1_000..4_900).contains(&here), "{here}");
    rig.reach(0, to(1_000, 2));
    assert_eq!(rig.devices[0].position(), 1_000);
    assert!(rig.told(0x202).contains(&vec![0x3F, 0]), "at once: {:?}", rig.told(0x202));
    // The same again is nothing new; another number is.
    rig.reach(0, Order::Move(Motion::Position { target: 100, velocity: None, relative: true, serial: 3 }));
    rig.set(0, Order::Move(Motion::Position { target: 100, velocity: None, relative: true, serial: 3 }));
    rig.run_ms(50);
    assert_eq!(rig.devices[0].position(), 1_100);
    rig.reach(
        0,
        Order::Move(Motion::Position { target: 100, velocity: Some(77), relative: true, serial: 4 }),
    );
    assert_eq!((rig.devices[0].position(), rig.devices[0].get(0x6081, 0)), (1_200, 77));
}

/// A halt that is over does not let go on what was halted.
#[test]
fn what_was_halted_is_forgotten() {
    let mut rig = rig();
    rig.set(0, to(50_000, 1));
    rig.run_ms(100);
    rig.reach(0, Order::Hold);
    let here = rig.devices[0].position();
    assert!(here < 49_000);
    rig.run_ms(100);
    assert_eq!(rig.devices[0].position(), here);
    rig.reach(0, Order::Move(Motion::Position { target: 10, velocity: None, relative: true, serial: 2 }));
    assert_eq!(rig.devices[0].position(), here + 10, "from where it stands");
    assert!(rig.devices[0].words.iter().all(|word| word & 0x110 != 0x110), "no set-point in a halt");
}

#[test]
fn a_velocity_runs_until_it_is_held() {
    let mut rig = rig();
    rig.reach(0, Order::Move(Motion::Velocity(20)));
    let here = rig.devices[0].position();
    rig.run_ms(100);
    assert_eq!(rig.devices[0].position() - here, 2_000);
    rig.reach(0, Order::Move(Motion::Velocity(-20)));
    rig.run_ms(100);
    assert!(rig.told(0x502).contains(&vec![0x0F, 0, 0xEC, 0xFF, 0xFF, 0xFF]));
    rig.reach(0, Order::Hold);
    assert_eq!((rig.devices[0].speed, rig.devices[0].get(0x60FF, 0)), (0, 0));
    assert!(rig.devices[0].is_enabled());
    // To another mode on the run: it stands in between.
    rig.reach(0, Order::Move(Motion::Velocity(20)));
    rig.sent.clear();
    rig.reach(0, to(0, 1));
    assert_eq!(rig.told(0x202)[0], [0x0F, 0x01], "it is halted first");
    assert_eq!(rig.devices[0].position(), 0);
}

/// No receive PDO has the target torque: it is written.
#[test]
fn a_torque_is_written_and_taken_back() {
    let mut rig = rig();
    rig.set(0, Order::Move(Motion::Torque(300)));
    rig.run_ms(100);
    assert_eq!((rig.devices[0].get(0x6071, 0), rig.report(0).mode), (300, Some(Mode::ProfileTorque)));
    rig.devices[0].speed = 0;
    rig.reach(0, Order::Hold);
    assert_eq!(rig.devices[0].get(0x6071, 0), 0);
    assert_eq!(rig.report(0).mode, Some(Mode::ProfilePosition), "a torque of nothing holds nothing");
}

#[test]
fn homing_by_a_method() {
    let mut rig = rig();
    rig.devices[0].put(0x6064, 0, 77);
    let method = Method::new(35);
    rig.reach(0, Order::Move(Motion::Home { method, serial: 1 }));
    assert_eq!(rig.devices[0].get(0x6098, 0), 35);
    assert_eq!(rig.devices[0].position(), 0);
    // Taken back in the middle.
    rig.set(0, Order::Move(Motion::Home { method, serial: 2 }));
    rig.run_ms(10);
    rig.reach(0, Order::Hold);
    assert!(!rig.report(0).homed);
}

/// What a jog needs besides its mode is not known.
#[test]
fn a_manufacturers_mode_is_selected_and_no_more() {
    let mut rig = rig();
    rig.reach(0, Order::Move(Motion::Mode(Mode::JOG)));
    assert_eq!(rig.report(0).mode, Some(Mode::JOG));
    assert!(rig.devices[0].words.iter().all(|word| word & !0x0F == 0), "{:X?}", rig.devices[0].words);
    rig.set(0, Order::Move(Motion::Mode(Mode::Vendor(-2))));
    rig.run_ms(10);
    assert_eq!(rig.progress(0), Progress::Failed(Failure::NoMode(Mode::Vendor(-2))));
}

#[test]
fn a_mode_that_is_not_shown_fails() {
    let mut rig = rig();
    rig.devices[0].stubborn = true;
    rig.set(0, Order::Move(Motion::Velocity(20)));
    rig.run_ms(1_500);
    assert_eq!(rig.progress(0), Progress::Failed(Failure::Mode(Mode::ProfileVelocity)));
    assert!(!rig.devices[0].is_enabled());
}
