//! The desk with a mock clock: fair order, stops first, deadlines, the breaker and the lease.

use core::task::{Context, Poll, Waker};

use puente_line::{Duration, Instant};
use puente_modbus::{Evidence, Outcome, Pdu};

use super::*;
use crate::bus::{End, Haste, Next, Ticket, Work};
use crate::port::limits::PIPELINE;

const LEASE: Duration = Duration::from_millis(250);

fn desk() -> Box<Desk> {
    let mut units = Units::default();
    (1..=16).for_each(|unit| units.insert(unit));
    let spec =
        BusSpec { units, queue_timeout: Duration::from_secs(3), reply_timeout: Duration::from_millis(500) };
    let desk = Box::new(const { Desk::new() });
    desk.configure([spec], LEASE);
    desk
}

fn at(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

/// A request whose PDU tells the seat.
fn order(seat: u8, unit: u8, class: Class) -> Order<'static> {
    Order { seat, bus: 0, unit, class, pdu: Box::leak(Box::new([3, 0, seat, 0, 1])) }
}

fn submit<'d>(desk: &'d Desk, now: Instant, order: Order<'_>) -> Pending<'d> {
    desk.submit(now, order).unwrap_or_else(|failure| panic!("{failure}"))
}

/// The next job for the bus, by ticket and the seat in its PDU.
fn next(desk: &Desk, now: Instant) -> Option<(Ticket, u8)> {
    let queue = BusQueue { desk, bus: 0 };
    match queue.next(now, |_, _| Instant::ZERO) {
        Next::Job(job) => Some((job.ticket, queue.request(job.ticket, |pdu| *pdu.get(2).expect("seat")))),
        Next::Wait(_) => None,
    }
}

fn answer(desk: &Desk, now: Instant, ticket: Ticket) {
    let end = End::Master(Outcome::Reply(&[3, 2, 0, 7]));
    (BusQueue { desk, bus: 0 }).finish(now, ticket, end);
}

fn miss(desk: &Desk, now: Instant, ticket: Ticket) {
    (BusQueue { desk, bus: 0 }).finish(now, ticket, End::Master(Outcome::NoReply(Evidence::Silence)));
}

fn poll(mut pending: Pending<'_>) -> Option<Result<Pdu, Failure>> {
    let context = &mut Context::from_waker(Waker::noop());
    let owned = |answer: Result<&[u8], Failure>| answer.map(|pdu| Pdu::from_slice(pdu).expect("a PDU"));
    match pending.poll_answer(context, owned) {
        Poll::Ready(answer) => Some(answer),
        Poll::Pending => None,
    }
}

#[test]
fn clients_take_turns_whatever_they_queue() {
    let desk = desk();
    let mut pending = [const { None }; 9];
    let greedy = [0, 0, 0, 0, 0, 0, 1, 2, 1];
    for (place, seat) in pending.iter_mut().zip(greedy) {
        *place = Some(submit(&desk, at(0), order(seat, 1, Class::Free)));
    }
    let mut served = [0; 9];
    for place in &mut served {
        let (ticket, seat) = next(&desk, at(1)).expect("a job");
        answer(&desk, at(1), ticket);
        *place = seat;
    }
    assert_eq!(served, [1, 2, 0, 1, 0, 0, 0, 0, 0]);
}

#[test]
fn a_stop_goes_first() {
    let desk = desk();
    let _reads = [0, 1, 2].map(|seat| submit(&desk, at(0), order(seat, 1, Class::Free)));
    let _stop = submit(&desk, at(0), order(9, 1, Class::Stop));
    assert_eq!(next(&desk, at(1)).map(|(_, seat)| seat), Some(9));
}

#[test]
fn the_queue_is_bounded_and_has_room_for_a_stop() {
    let desk = desk();
    let mut pending = std::vec::Vec::new();
    for seat in 0.. {
        match desk.submit(at(0), order(seat, 1, Class::Free)) {
            Ok(accepted) => pending.push(accepted),
            Err(failure) => {
                assert_eq!(failure, Failure::NotSent(Reason::QueueFull));
                break;
            }
        }
    }
    assert!(pending.len() < TICKETS);
    let _stop = submit(&desk, at(0), order(200, 1, Class::Stop));
    assert_eq!(next(&desk, at(1)).map(|(_, seat)| seat), Some(200));
}

#[test]
fn one_client_has_a_bounded_share() {
    let desk = desk();
    let _share: std::vec::Vec<_> =
        (0..PIPELINE).map(|_| submit(&desk, at(0), order(0, 1, Class::Free))).collect();
    let refused = desk.submit(at(0), order(0, 1, Class::Free)).map(|_| ());
    assert_eq!(refused, Err(Failure::NotSent(Reason::QueueFull)));
    let _other = submit(&desk, at(0), order(1, 1, Class::Free));
}

#[test]
fn what_is_dropped_in_the_queue_is_never_sent() {
    let desk = desk();
    drop(submit(&desk, at(0), order(0, 1, Class::Free)));
    assert_eq!(next(&desk, at(1)), None);
    assert_eq!(desk.tickets().0, 0);
}

#[test]
fn a_stop_is_sent_though_it_was_dropped_in_the_queue() {
    let desk = desk();
    drop(submit(&desk, at(0), order(7, 1, Class::Stop)));
    let (ticket, seat) = next(&desk, at(1)).expect("the stop");
    assert_eq!((seat, desk.tickets().0), (7, 1));
    answer(&desk, at(2), ticket);
    assert_eq!(desk.tickets().0, 0);
}

#[test]
fn what_starts_motion_has_every_other_turn() {
    let desk = desk();
    let permit = desk.lease(at(0), 0, ME, None).expect("free");
    let mut pending = std::vec::Vec::new();
    for seat in 0..4 {
        pending.push(submit(&desk, at(0), order(seat, 1, Class::Free)));
    }
    for _ in 0..3 {
        pending.push(submit(&desk, at(0), order(9, 1, Class::Motion(permit))));
    }
    let mut served = std::vec::Vec::new();
    while let Some((ticket, seat)) = next(&desk, at(1)) {
        answer(&desk, at(1), ticket);
        served.push(seat);
    }
    assert_eq!(served, [9, 0, 9, 1, 9, 2, 3]);
}

#[test]
fn a_stop_goes_out_in_the_quarantine_of_its_slave() {
    let desk = desk();
    let ready = |_, haste| if haste == Haste::InQuarantineToo { Instant::ZERO } else { at(500) };
    let queue = BusQueue { desk: &desk, bus: 0 };
    let write = |value| Pdu::from_slice(&[6, 0x10, 0x24, 0, value]).expect("short");
    let _write = submit(&desk, at(0), Order { pdu: &write(1), ..order(0, 1, Class::Free) });
    // The reply to a jog with function 10h would pass for the reply to this stop.
    let pdu = &[0x10, 0x10, 0x24, 0, 1, 2, 0, 0];
    let _not_repeated = submit(&desk, at(0), Order { pdu, ..order(0, 1, Class::Stop) });
    assert!(matches!(queue.next(at(1), ready), Next::Wait(_)));
    let _stop = submit(&desk, at(0), Order { pdu: &write(0), ..order(0, 1, Class::Stop) });
    assert!(
        matches!(queue.next(at(1), ready), Next::Job(job) if queue.request(job.ticket, |pdu| pdu == write(0)))
    );
}

#[test]
fn what_is_dropped_on_the_wire_frees_its_place_when_it_ends() {
    let desk = desk();
    let pending = submit(&desk, at(0), order(0, 1, Class::Free));
    let (ticket, _) = next(&desk, at(1)).expect("a job");
    drop(pending);
    assert_eq!(desk.tickets().0, 1);
    answer(&desk, at(2), ticket);
    assert_eq!(desk.tickets().0, 0);
}

#[test]
fn a_request_that_waited_too_long_is_not_sent() {
    let desk = desk();
    let pending = submit(&desk, at(0), order(0, 1, Class::Free));
    assert_eq!(next(&desk, at(3000)), None);
    assert_eq!(poll(pending), Some(Err(Failure::NotSent(Reason::Expired))));
}

#[test]
fn a_busy_unit_does_not_hold_others_up() {
    let desk = desk();
    let _first = submit(&desk, at(0), order(0, 1, Class::Free));
    let _second = submit(&desk, at(0), order(1, 2, Class::Free));
    let ready = |unit, _| if unit == 1 { at(40) } else { Instant::ZERO };
    let queue = BusQueue { desk: &desk, bus: 0 };
    assert!(matches!(queue.next(at(1), ready), Next::Job(job) if job.unit == 2));
    assert!(matches!(queue.next(at(1), ready), Next::Wait(Some(moment)) if moment == at(40)));
}

#[test]
fn a_slave_never_heard_rests_after_one_miss_and_is_probed_later() {
    let desk = desk();
    let pending = submit(&desk, at(0), order(0, 5, Class::Free));
    let (ticket, _) = next(&desk, at(0)).expect("a job");
    miss(&desk, at(500), ticket);
    assert_eq!(poll(pending), Some(Err(Failure::NoReply(Evidence::Silence))));

    let pending = submit(&desk, at(600), order(0, 5, Class::Free));
    assert_eq!(next(&desk, at(600)), None);
    let left = Duration::from_millis(4400);
    assert_eq!(poll(pending), Some(Err(Failure::NotSent(Reason::Resting(left)))));

    let _stop = submit(&desk, at(600), order(0, 5, Class::Stop));
    assert!(next(&desk, at(600)).is_some(), "a stop goes to a resting slave too");
    let _probe = submit(&desk, at(5000), order(0, 5, Class::Free));
    assert!(next(&desk, at(5000)).is_some());
}

#[test]
fn a_slave_that_has_answered_may_miss_once() {
    let desk = desk();
    let send = |now| {
        let pending = submit(&desk, now, order(0, 5, Class::Free));
        next(&desk, now).map(|(ticket, _)| (ticket, pending))
    };
    let (ticket, _pending) = send(at(0)).expect("first");
    answer(&desk, at(10), ticket);
    let (ticket, _pending) = send(at(20)).expect("second");
    miss(&desk, at(520), ticket);
    let (ticket, _pending) = send(at(530)).expect("after one miss");
    miss(&desk, at(1030), ticket);
    assert!(send(at(1040)).is_none(), "after two misses");
}

const ME: Holder = Holder::Connection(1);
const OTHER: Holder = Holder::Connection(2);

#[test]
fn a_lease_keeps_others_out_until_it_ends() {
    let desk = desk();
    let permit = desk.lease(at(0), 0, ME, None).expect("free");
    assert!(desk.moving(at(10), permit));
    assert_eq!(desk.lease(at(100), 0, OTHER, None), Err(Leased::By(ME, Duration::from_millis(160))));
    assert!(desk.permit(at(100), 0, OTHER).is_err());
    assert!(desk.permit(at(100), 0, ME).is_ok());
    desk.renew(at(200), 1);
    assert!(desk.lease(at(440), 0, OTHER, None).is_err(), "renewed until 450");
    assert_eq!(desk.lease(at(450), 0, OTHER, None), Err(Leased::Stopping));
    assert_eq!(desk.event(0).map(|event| (event.cause, event.holder)), Some((Cause::Expired, ME)));
}

#[test]
fn nothing_guarded_is_sent_after_the_end_of_the_lease() {
    for end in ["stop", "expiry", "leave"] {
        let desk = desk();
        let permit = desk.lease(at(0), 0, ME, None).expect("free");
        desk.moving(at(0), permit);
        let pending = submit(&desk, at(1), order(0, 1, Class::Guarded(permit)));
        let now = match end {
            "stop" => {
                desk.revoke(at(2), 0, OTHER).done();
                at(2)
            }
            "leave" => {
                desk.leave(at(2), 1);
                at(2)
            }
            _ => at(250),
        };
        assert_eq!(next(&desk, now), None, "{end}");
        assert_eq!(poll(pending), Some(Err(Failure::NotSent(Reason::Stopped))), "{end}");
    }
}

#[test]
fn who_was_stopped_by_another_must_keep_still() {
    let desk = desk();
    let permit = desk.lease(at(0), 0, ME, None).expect("free");
    desk.moving(at(0), permit);
    desk.revoke(at(100), 0, OTHER).done();
    assert_eq!(desk.event(0).map(|event| event.cause), Some(Cause::Stopped));
    // A button that is still held asks again and again, and gets nothing by it.
    for millis in (200..3000).step_by(200) {
        assert!(matches!(desk.lease(at(millis), 0, ME, None), Err(Leased::Standstill(_))), "{millis}");
    }
    assert!(desk.lease(at(4000), 0, ME, None).is_ok());
}

#[test]
fn an_http_lease_is_not_renewed_by_other_traffic() {
    let desk = desk();
    let hold = Some(Duration::from_millis(500));
    let permit = desk.lease(at(0), 0, Holder::Http(1), hold).expect("free");
    desk.moving(at(0), permit);
    desk.renew(at(400), 1);
    assert!(desk.lease(at(499), 0, OTHER, None).is_err());
    assert_eq!(desk.lease(at(500), 0, OTHER, None), Err(Leased::Stopping));
}

#[test]
fn the_lease_of_a_connection_that_leaves_is_lost_at_once() {
    let desk = desk();
    let permit = desk.lease(at(0), 0, ME, None).expect("free");
    desk.moving(at(0), permit);
    desk.leave(at(5), 2);
    assert!(desk.leased(at(5), 0).is_some(), "somebody else left");
    desk.leave(at(6), 1);
    assert_eq!(desk.leased(at(6), 0), None);
    let cause = embassy_futures::block_on(desk.owed(0));
    assert_eq!(cause, Cause::Disconnected);
}

/// A desk whose axis 0 turns under the lease of [`ME`].
fn turning() -> (Box<Desk>, Permit) {
    let desk = desk();
    let permit = desk.lease(at(0), 0, ME, None).expect("free");
    assert!(desk.moving(at(0), permit));
    (desk, permit)
}

#[test]
fn nobody_gets_an_axis_whose_stop_is_owed() {
    let (desk, permit) = turning();
    desk.leave(at(1), 1);
    assert!(desk.owes(0));
    assert_eq!(desk.lease(at(2), 0, OTHER, None), Err(Leased::Stopping));
    assert_eq!(desk.lease(at(2), 0, ME, None), Err(Leased::Stopping));
    let duty = desk.revoke(at(3), 0, Holder::Gateway);
    assert!(!desk.owes(0), "it is in hand");
    duty.done();
    assert!(!desk.owes(0));
    assert!(desk.lease(at(4), 0, OTHER, None).is_ok());
    assert!(!desk.moving(at(5), permit), "what was started under the old lease does not renew the new one");
}

#[test]
fn a_stop_that_fails_falls_to_the_watchman() {
    for by in [ME, OTHER, Holder::Gateway] {
        let (desk, _) = turning();
        drop(desk.revoke(at(1), 0, by));
        assert!(desk.owes(0), "{by:?}");
    }
}

#[test]
fn a_stop_of_an_axis_that_nobody_moved_is_its_clients_own_affair() {
    let desk = desk();
    drop(desk.revoke(at(1), 0, ME));
    assert!(!desk.owes(0));
}

#[test]
fn of_two_stops_the_later_one_counts() {
    let (desk, _) = turning();
    let first = desk.revoke(at(1), 0, ME);
    let second = desk.revoke(at(2), 0, OTHER);
    drop(first);
    assert!(!desk.owes(0), "the second is in hand");
    drop(second);
    assert!(desk.owes(0));

    let (desk, _) = turning();
    let first = desk.revoke(at(1), 0, ME);
    let permit = desk.lease(at(2), 0, OTHER, None).expect("free");
    assert!(desk.moving(at(2), permit));
    desk.leave(at(3), 2);
    first.done();
    assert!(desk.owes(0), "the first stop was before this motion");
}

#[test]
fn a_stop_of_one_direction_leaves_its_client_answerable_for_the_other() {
    let (desk, permit) = turning();
    let pending = submit(&desk, at(1), order(0, 1, Class::Motion(permit)));
    desk.revoke_permits(at(1), 0, ME);
    assert_eq!(next(&desk, at(1)), None);
    assert_eq!(poll(pending), Some(Err(Failure::NotSent(Reason::Stopped))));
    assert!(desk.leased(at(1), 0).is_some());
    desk.leave(at(2), 1);
    assert!(desk.owes(0));
}

#[test]
fn a_stop_of_one_direction_by_another_stops_the_axis_altogether() {
    let (desk, _) = turning();
    desk.revoke_permits(at(1), 0, OTHER);
    assert!(desk.owes(0));
    assert_eq!(desk.event(0).map(|event| event.cause), Some(Cause::Stopped));
    desk.revoke(at(2), 0, Holder::Gateway).done();
    assert!(matches!(desk.lease(at(3), 0, ME, None), Err(Leased::Standstill(_))));
}

/// What the port was told of axis 0.
fn may_move(desk: &Desk) -> bool {
    desk.with(|state| state.leases.first().is_some_and(lease::AxisLease::may_move))
}

#[test]
fn an_axis_may_move_from_its_lease_until_its_stop_is_confirmed() {
    let desk = desk();
    assert!(!may_move(&desk));
    let permit = desk.lease(at(0), 0, ME, None).expect("free");
    assert!(may_move(&desk), "before anything is sent");
    desk.unlease(permit);
    assert!(!may_move(&desk));

    let (desk, _) = turning();
    desk.leave(at(1), 1);
    assert!(may_move(&desk));
    drop(desk.revoke(at(2), 0, Holder::Gateway));
    assert!(may_move(&desk), "not confirmed");
    desk.revoke(at(3), 0, Holder::Gateway).done();
    assert!(!may_move(&desk));
}

#[test]
fn after_a_restart_an_axis_is_stopped_before_anybody_has_it() {
    let desk = desk();
    desk.restarted(at(0), 0);
    assert!(desk.owes(0) && !desk.owes(1) && may_move(&desk));
    assert_eq!(desk.lease(at(1), 0, ME, None), Err(Leased::Stopping));
    assert_eq!(desk.event(0).map(|event| event.cause), Some(Cause::Restarted));
    desk.revoke(at(2), 0, Holder::Gateway).done();
    assert!(!may_move(&desk) && desk.lease(at(3), 0, ME, None).is_ok());
    assert_eq!(desk.event(0).map(|event| event.cause), Some(Cause::Restarted), "it stays until cleared");
}

#[test]
fn a_bus_that_breaks_its_word_hangs() {
    let desk = desk();
    let bus = BusQueue { desk: &desk, bus: 0 };
    assert_eq!(desk.hung(at(1_000_000)), None, "it was never started");
    bus.alive(at(500));
    assert_eq!(desk.hung(at(500)), None);
    assert_eq!(desk.hung(at(501)), Some(0));
    bus.alive(at(900));
    assert_eq!(desk.hung(at(501)), None);
}

#[test]
fn units_are_read_and_printed() {
    let units: Units = "1-16, 20,247".parse().expect("units");
    assert!(units.contains(1) && units.contains(16) && units.contains(20) && units.contains(247));
    assert!(!units.contains(0) && !units.contains(17));
    assert_eq!(std::format!("{units}"), "1-16,20,247");
    for bad in ["", "0", "248", "5-3", "a", "1-", "1,,2"] {
        assert!(bad.parse::<Units>().is_err(), "{bad}");
    }
}
