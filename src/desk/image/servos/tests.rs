//! Drives in the image, with a mock clock: what is lost with the lease, and what ends the need for it.

use core::marker::PhantomData;

use puente_drives::cia402::{Mode, Statusword};
use puente_line::{Duration, Instant};
use puente_servos::{Failure, Node};

use super::*;
use crate::bus::Image;
use crate::desk::{BusImage, BusSpec, Desk, Holder, Permit, Units};

const LEASE: Duration = Duration::from_millis(250);
const HOLDER: Holder = Holder::Connection(1);
const OTHER: Holder = Holder::Connection(2);
const THERE: Moves = Moves::Position { target: 1000, velocity: None, relative: false, serial: 1 };
const HOME: Moves = Moves::Home { method: None, serial: 2 };

fn at(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

fn desk() -> Box<Desk> {
    let spec =
        BusSpec { units: Units::default(), queue_timeout: Duration::ZERO, reply_timeout: Duration::ZERO };
    let desk = Box::new(const { Desk::new() });
    desk.configure([spec], LEASE);
    desk.add_cyclic(0, 0, Default::default());
    desk
}

fn bus(desk: &Desk) -> BusImage<'_, Servos> {
    BusImage { desk, bus: 0, axes: [0].into_iter().collect(), kind: PhantomData }
}

fn order(desk: &Desk, now: Instant) -> Order {
    let mut shown = None;
    bus(desk).outputs(now, |_, order| shown = Some(order));
    shown.expect("an axis")
}

/// The drive hears what is wanted and is so far with it.
fn says(desk: &Desk, now: Instant, progress: Progress) {
    order(desk, now);
    let report = Report {
        node: Node::Present,
        status: Some(Statusword(0x0637)),
        mode: Some(Mode::ProfilePosition),
        position: Some(7),
        velocity: Some(0),
        progress,
        homed: false,
        emergency: None,
        fault: None,
    };
    bus(desk).reported(now, 0, report, true);
}

fn moving(desk: &Desk, now: Instant, motion: Moves) -> Permit {
    let permit = desk.lease(now, 0, HOLDER, None).expect("a lease");
    assert!(desk.hold(now, permit));
    says(desk, now, Progress::Reached);
    assert!(desk.go(now, permit, Motion::Servo(motion)));
    assert_eq!(order(desk, now), Order::Move(motion));
    permit
}

#[test]
fn the_end_of_the_lease_is_a_quick_stop() {
    for motion in [THERE, HOME, Moves::Velocity(50), Moves::Torque(-20), Moves::Mode(Mode::ProfileTorque)] {
        let desk = desk();
        let permit = moving(&desk, at(0), motion);
        says(&desk, at(100), Progress::Running);
        assert_eq!(order(&desk, at(249)), Order::Move(motion));
        assert_eq!(order(&desk, at(250)), Order::Stop, "nobody but the pump looks");
        assert!(!desk.go(at(251), permit, Motion::Servo(motion)));
    }
}

#[test]
fn what_has_arrived_needs_nobody_to_show_life() {
    for motion in [THERE, HOME, Moves::Mode(Mode::Homing)] {
        let desk = desk();
        moving(&desk, at(0), motion);
        says(&desk, at(10), Progress::Running);
        assert_eq!(order(&desk, at(10)), Order::Move(motion));
        says(&desk, at(20), Progress::Reached);
        assert_eq!(order(&desk, at(20)), Order::Hold);
        assert_eq!(desk.leased(at(20), 0), None);
        assert_eq!(order(&desk, at(10_000)), Order::Hold);
        assert!(desk.at_rest());
    }
    // A velocity that is reached goes on.
    for motion in [Moves::Velocity(50), Moves::Torque(5), Moves::Mode(Mode::JOG)] {
        let desk = desk();
        moving(&desk, at(0), motion);
        says(&desk, at(20), Progress::Reached);
        assert_eq!(order(&desk, at(20)), Order::Move(motion));
        assert!(desk.leased(at(20), 0).is_some());
    }
}

/// That a drive has arrived was said of the move before, when the bus had not seen the next one.
#[test]
fn another_move_has_not_arrived_with_the_one_before() {
    let desk = desk();
    let permit = moving(&desk, at(0), THERE);
    let next = Moves::Position { target: 2000, velocity: None, relative: false, serial: 2 };
    assert!(desk.go(at(5), permit, Motion::Servo(next)));
    let input = desk.view(at(5), 0).servo().expect("a report").1;
    bus(&desk).reported(at(6), 0, Report { progress: Progress::Reached, ..input }, true);
    assert_eq!(order(&desk, at(6)), Order::Move(next));
}

#[test]
fn a_motion_that_failed_stays_to_be_told_until_its_lease_ends() {
    let desk = desk();
    moving(&desk, at(0), HOME);
    says(&desk, at(10), Progress::Failed(Failure::Homing));
    assert_eq!(order(&desk, at(11)), Order::Move(HOME));
    assert_eq!(order(&desk, at(250)), Order::Stop);
}

#[test]
fn a_quick_stop_is_wanted_of_what_holds_too_and_off_wins() {
    let desk = desk();
    let permit = moving(&desk, at(0), THERE);
    assert!(desk.hold(at(1), permit));
    desk.quick_stop(at(1), 0);
    assert_eq!(order(&desk, at(1)), Order::Stop);
    says(&desk, at(2), Progress::Running);
    assert_eq!(order(&desk, at(2)), Order::Stop);
    desk.switch_off(at(3), 0);
    desk.quick_stop(at(3), 0);
    desk.reset(at(3), permit, 9);
    assert_eq!(order(&desk, at(3)), Order::Off);
    says(&desk, at(4), Progress::Reached);
    assert_eq!(order(&desk, at(4)), Order::Observe);
}

#[test]
fn a_fault_is_reset_once() {
    for end in [Progress::Reached, Progress::Failed(Failure::Fault(None))] {
        let desk = desk();
        let permit = desk.permit(at(0), 0, HOLDER).expect("a permit");
        assert!(desk.reset(at(0), permit, 3));
        assert_eq!(order(&desk, at(0)), Order::Reset { serial: 3 });
        says(&desk, at(1), Progress::Running);
        assert_eq!(order(&desk, at(1)), Order::Reset { serial: 3 });
        says(&desk, at(2), end);
        assert_eq!(order(&desk, at(2)), Order::Observe);
    }
}

#[test]
fn what_fell_is_let_go_of_and_its_commander_keeps_still() {
    for (why, cause) in [
        (Why::Fault(Some(0x8611)), Cause::DriveFault),
        (Why::Lost, Cause::DriveLost),
        (Why::Bus, Cause::DriveLost),
    ] {
        let desk = desk();
        moving(&desk, at(0), THERE);
        bus(&desk).fell(at(5), 0, why);
        assert_eq!(order(&desk, at(5)), Order::Observe);
        let event = desk.event(0).expect("an event");
        assert_eq!((event.cause, event.holder), (cause, HOLDER));
        assert!(desk.lease(at(6), 0, HOLDER, None).is_err());
        // Of one that is lost nobody knows that it stands.
        assert_eq!(desk.owes(0), cause == Cause::DriveLost);
        assert_eq!(desk.lease(at(6), 0, OTHER, None).is_ok(), cause == Cause::DriveFault);
    }
}
