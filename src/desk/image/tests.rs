//! The image with a mock clock: motion under a permit only, and answers that answer.

use core::marker::PhantomData;
use core::task::{Context, Waker};

use puente_drives::pid::Cause as Fault;
use puente_drives::pid::State as Module;
use puente_modules::master::Output;
use puente_modules::{Control, Refusal};

use super::*;
use crate::bus::Image;
use crate::desk::{BusSpec, Cause, Event as Latched, Holder, Units};

const LEASE: Duration = Duration::from_millis(250);
const HOLDER: Holder = Holder::Connection(1);
const OTHER: Holder = Holder::Connection(2);

fn at(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

/// A desk whose axis 1 is the only one of its only bus.
fn desk() -> Box<Desk> {
    let spec =
        BusSpec { units: Units::default(), queue_timeout: Duration::ZERO, reply_timeout: Duration::ZERO };
    let desk = Box::new(const { Desk::new() });
    desk.configure([spec], LEASE);
    desk.add_cyclic(1, 0, Gains::new(0.5, 0.0, 0.0).expect("gains"));
    desk
}

fn bus(desk: &Desk) -> BusImage<'_, Modules> {
    BusImage { desk, bus: 0, axes: [1].into_iter().collect(), kind: PhantomData }
}

fn output(desk: &Desk, now: Instant) -> Output {
    let mut shown = None;
    bus(desk).outputs(now, |place, output| shown = Some((place, output)));
    let (place, output) = shown.expect("an axis");
    assert_eq!(place, 0);
    output
}

fn control(desk: &Desk, now: Instant) -> Control {
    output(desk, now).control
}

fn report(desk: &Desk, now: Instant, state: Module, current: bool) {
    let refused = (state == Module::Disabled).then_some(Refusal::NoEdge);
    if current {
        output(desk, now);
    }
    let report = Report { state, refused, position: 77, following_error: 0, velocity: 0.0, command: 0.0 };
    bus(desk).reported(now, 0, report, current);
}

/// An axis under current and its permit.
fn moving(desk: &Desk, now: Instant) -> Permit {
    let permit = desk.lease(now, 1, HOLDER, None).expect("a lease");
    assert!(desk.hold(now, permit));
    report(desk, now, Module::Held, true);
    assert!(desk.go(now, permit, Motion::Follow(1000)));
    permit
}

#[test]
fn nothing_is_wanted_at_first_and_no_gains_are_lost() {
    let desk = desk();
    let first = output(&desk, at(0));
    assert_eq!((first.control, first.gains.kp(), first.set_point), (Control::Observe, 0.5, 0));
    let mut others = 0;
    BusImage { axes: [0, 7].into_iter().collect(), ..bus(&desk) }.outputs(at(0), |_, _| others += 1);
    assert_eq!(others, 0, "they are on no cyclic bus");
    assert_eq!(desk.view(at(0), 0), desk.view(at(0), 200));
}

#[test]
fn motion_is_wanted_under_a_lease_and_ends_with_it() {
    let desk = desk();
    let permit = desk.permit(at(0), 1, HOLDER).expect("a permit");
    assert!(desk.hold(at(0), permit));
    assert!(!desk.go(at(0), permit, Motion::Follow(1000)), "there is no lease");
    assert_eq!(control(&desk, at(0)), Control::Hold);
    let permit = moving(&desk, at(0));
    assert_eq!((control(&desk, at(1)), output(&desk, at(1)).set_point), (Control::Follow, 1000));
    // It runs out, and nobody but the pump looks.
    assert_eq!(control(&desk, at(249)), Control::Follow);
    assert_eq!(control(&desk, at(250)), Control::Hold);
    assert!(!desk.go(at(251), permit, Motion::Follow(2000)));
    assert_eq!(desk.event(1).map(|event| event.cause), None, "the watchman finds it");
    assert!(desk.lease(at(251), 1, OTHER, None).is_err(), "and stops it, before it moves again");
    assert_eq!(desk.event(1).map(|event| event.cause), Some(Cause::Expired));
}

#[test]
fn whoever_is_gone_moves_nothing() {
    for leave in [
        (|desk: &Desk| desk.leave(at(10), 1)) as fn(&Desk),
        |desk| desk.close(at(10)),
        |desk| core::mem::forget(desk.revoke(at(10), 1, OTHER)),
        |desk| desk.revoke_permits(at(10), 1, OTHER),
    ] {
        let desk = desk();
        moving(&desk, at(0));
        assert_eq!(control(&desk, at(9)), Control::Follow);
        leave(&desk);
        assert_eq!(control(&desk, at(10)), Control::Hold);
    }
}

#[test]
fn a_stop_puts_nothing_under_current() {
    let desk = desk();
    desk.stop_cyclic(at(0), 1);
    let stop = output(&desk, at(0));
    assert_eq!((stop.control, stop.gains.hold()), (Control::Hold, false));
    report(&desk, at(1), Module::Enabled, true);
    report(&desk, at(2), Module::Disabled, false);
    assert_eq!(control(&desk, at(2)), Control::Hold, "what was before does not count");
    report(&desk, at(3), Module::Held, true);
    assert_eq!(control(&desk, at(3)), Control::Observe);
    // One of its own stays under current.
    moving(&desk, at(4));
    desk.stop_cyclic(at(5), 1);
    report(&desk, at(6), Module::Held, true);
    let held = output(&desk, at(6));
    assert_eq!((held.control, held.gains.hold()), (Control::Hold, true));
}

#[test]
fn off_is_said_until_it_is_so_whatever_else_is_wanted() {
    let desk = desk();
    let permit = moving(&desk, at(0));
    desk.switch_off(at(1), 1);
    desk.stop_cyclic(at(1), 1);
    desk.hold(at(1), permit);
    desk.go(at(1), permit, Motion::Follow(5));
    desk.give_up(at(1), 1);
    bus(&desk).fell(at(1), 0, Control::Observe);
    for (state, current) in
        [(Module::Enabled, true), (Module::Disabled, false), (Module::Fault(Fault::Amplifier), true)]
    {
        report(&desk, at(2), state, current);
        assert_eq!(control(&desk, at(2)), Control::Off);
    }
    report(&desk, at(3), Module::Disabled, true);
    assert_eq!(control(&desk, at(3)), Control::Observe);
}

#[test]
fn an_answer_is_one_to_what_is_wanted_now() {
    let desk = desk();
    let answers = |now| desk.view(now, 1).answer().is_some();
    assert!(!answers(at(0)));
    report(&desk, at(0), Module::Disabled, true);
    assert!(answers(at(0)));
    let permit = moving(&desk, at(1));
    assert!(!answers(at(1)));
    report(&desk, at(2), Module::Enabled, true);
    assert!(answers(at(2)));
    assert!(desk.go(at(3), permit, Motion::Follow(2000)));
    assert!(answers(at(3)), "another aim is no other wish");
    assert!(desk.set_gains(at(4), permit, Gains::default()));
    assert!(!answers(at(4)), "other gains are");
}

/// A client may change what is wanted between two looks of the pump, which then takes what it had heard for the answer.
#[test]
fn a_report_answers_nothing_that_the_bus_has_not_seen() {
    let desk = desk();
    report(&desk, at(0), Module::Held, true);
    desk.stop_cyclic(at(1), 1);
    let held = Report {
        state: Module::Held,
        refused: None,
        position: 77,
        following_error: 0,
        velocity: 0.0,
        command: 0.0,
    };
    bus(&desk).reported(at(2), 0, held, true);
    assert_eq!(desk.view(at(2), 1).wish, Wish::Stop);
    report(&desk, at(3), Module::Held, true);
    assert_eq!(desk.view(at(3), 1).wish, Wish::Observe);
}

/// A module enables itself for one whom it has heard let go. What it said of a stop told nothing of that.
#[test]
fn what_ends_a_stop_or_an_off_is_no_answer_to_what_follows() {
    let wishes: [fn(&Desk); 2] = [|desk| desk.stop_cyclic(at(0), 1), |desk| desk.switch_off(at(0), 1)];
    for wish in wishes {
        let desk = desk();
        wish(&desk);
        report(&desk, at(1), Module::Disabled, true);
        assert_eq!(control(&desk, at(1)), Control::Observe);
        assert!(desk.view(at(1), 1).answer().is_none());
        report(&desk, at(2), Module::Disabled, true);
        assert!(desk.view(at(2), 1).answer().is_some());
    }
}

#[test]
fn a_drive_that_falls_ends_the_lease_of_its_commander_who_must_keep_still() {
    for (state, to, cause) in [
        (Module::Held, Control::Hold, Cause::Stopped),
        (Module::Disabled, Control::Observe, Cause::Stopped),
        (Module::Fault(Fault::Communication), Control::Observe, Cause::DriveFault),
    ] {
        let desk = desk();
        let permit = moving(&desk, at(0));
        report(&desk, at(5), state, true);
        bus(&desk).fell(at(5), 0, to);
        assert_eq!(control(&desk, at(5)), to);
        assert_eq!(desk.leased(at(5), 1), None);
        assert_eq!(desk.event(1), Some(Latched { cause, holder: HOLDER, at: at(5) }));
        assert!(!desk.hold(at(5), permit) && !desk.go(at(5), permit, Motion::Follow(1)));
        assert!(desk.lease(at(6), 1, HOLDER, None).is_err());
        assert!(desk.lease(at(6), 1, OTHER, None).is_ok());
        assert!(desk.at_rest() || desk.leased(at(6), 1).is_some(), "nobody has to stop it");
    }
}

#[test]
fn where_it_stands_is_where_it_is_held() {
    let desk = desk();
    report(&desk, at(0), Module::Disabled, true);
    assert_eq!(output(&desk, at(0)).set_point, 77);
}

#[test]
fn who_waits_is_woken_by_reports_and_by_wishes() {
    let desk = desk();
    let minute = Duration::from_secs(60);
    let mut held = core::pin::pin!(desk.until(1, minute, |view| Some(view.answer()?.module()?.state)));
    let mut poll = || held.as_mut().poll(&mut Context::from_waker(Waker::noop()));
    assert!(poll().is_pending());
    report(&desk, clock::now(), Module::Held, false);
    assert!(poll().is_pending());
    report(&desk, clock::now(), Module::Held, true);
    assert_eq!(poll(), Poll::Ready(Some(Module::Held)));
}

#[test]
fn a_report_is_fresh_for_a_while() {
    let desk = desk();
    let within = Duration::from_millis(100);
    report(&desk, at(5), Module::Held, false);
    assert!(desk.view(at(105), 1).fresh(at(105), within).is_some());
    assert!(desk.view(at(106), 1).fresh(at(106), within).is_none());
}
