//! Turns at the outgoing place, and what becomes of a frame there.

use core::marker::PhantomData;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use puente_framed::arbiter::Failure;
use puente_framed::{Class, Kind, frame, section};
use puente_line::Duration;

use super::*;
use crate::desk::{BusSpec, Holder};

fn desk() -> Box<Desk> {
    let desk = Box::new(const { Desk::new() });
    let spec =
        BusSpec { units: Units::default(), queue_timeout: Duration::ZERO, reply_timeout: Duration::ZERO };
    desk.configure([spec], Duration::from_millis(250));
    desk.send_frames_to(0);
    desk
}

fn bus(desk: &Desk) -> BusImage<'_, Modules> {
    BusImage { desk, bus: 0, axes: Vec::new(), kind: PhantomData }
}

fn poll<F: Future>(future: core::pin::Pin<&mut F>) -> Poll<F::Output> {
    future.poll(&mut Context::from_waker(Waker::noop()))
}

/// What is ready at once.
fn now<T>(future: impl Future<Output = T>) -> T {
    let Poll::Ready(value) = poll(pin!(future)) else { panic!("it waits") };
    value
}

/// A frame from one address to another.
fn frame(from: u8, to: u8) -> Frame {
    let mut body = Vec::<u8, 16>::new();
    section::push(&mut body, to, &[from]).expect("room");
    let mut frame = Frame::new();
    frame::emit(&mut frame, from, Kind::Single(Class::Data), &body).expect("a frame");
    frame
}

/// Has a client's turn, and gives the bus a frame with it.
fn put<'d>(desk: &'d Desk, seat: u8, bytes: &[u8], permits: Permits, stop: bool) -> Turn<'d> {
    let mut turn = now(desk.turn(seat));
    now(turn.frame()).extend_from_slice(bytes).expect("room");
    turn.send(permits, stop);
    turn
}

/// What the bus is shown, which it takes.
fn shown(desk: &Desk) -> Option<std::vec::Vec<u8>> {
    let mut shown = None;
    bus(desk).outgoing(Instant::ZERO, |frame| {
        shown = Some(frame.to_vec());
        Taken::Yes
    });
    shown
}

#[test]
fn who_comes_first_goes_first() {
    let desk = desk();
    let first = now(desk.turn(5));
    let mut second = pin!(desk.turn(3));
    let mut third = pin!(desk.turn(4));
    assert!(poll(second.as_mut()).is_pending());
    assert!(poll(third.as_mut()).is_pending());
    drop(first);
    assert!(poll(third.as_mut()).is_pending());
    let Poll::Ready(second) = poll(second) else { panic!("its turn") };
    drop(second);
    assert!(poll(third).is_ready());
}

/// Who was told that it is its turn, and goes away before it has looked, holds nobody up.
#[test]
fn who_goes_away_holds_nobody_up() {
    struct Told(core::sync::atomic::AtomicBool);
    impl std::task::Wake for Told {
        fn wake(self: std::sync::Arc<Self>) {
            self.0.store(true, core::sync::atomic::Ordering::Relaxed);
        }
    }
    let desk = desk();
    let first = now(desk.turn(1));
    let mut second = std::boxed::Box::pin(desk.turn(2));
    assert!(poll(second.as_mut()).is_pending());
    let told = std::sync::Arc::new(Told(Default::default()));
    let mut third = pin!(desk.turn(3));
    let waker = Waker::from(told.clone());
    assert!(third.as_mut().poll(&mut Context::from_waker(&waker)).is_pending());
    drop(first);
    assert!(!told.0.load(core::sync::atomic::Ordering::Relaxed));
    drop(second);
    assert!(told.0.load(core::sync::atomic::Ordering::Relaxed));
    assert!(poll(third).is_ready());
}

#[test]
fn a_frame_is_shown_once_and_its_client_hears_of_it() {
    let desk = desk();
    let bytes = frame(9, 17);
    let mut turn = put(&desk, 1, &bytes, Permits::new(), false);
    bus(&desk).outgoing(Instant::ZERO, |_| Taken::NotYet);
    assert!(poll(pin!(turn.outcome())).is_pending());
    assert_eq!(shown(&desk).as_deref(), Some(bytes.as_slice()));
    assert_eq!(shown(&desk), None);
    let outcome = Err(Undelivered::Line(Failure::NoEcho));
    bus(&desk).posted(outcome);
    assert_eq!(now(turn.outcome()), outcome);
    let counted = desk.mail_statistics();
    assert_eq!((counted.sent, counted.undelivered), (0, 1));
}

#[test]
fn a_frame_that_can_never_go_is_given_back() {
    let desk = desk();
    let mut turn = put(&desk, 1, &frame(9, 17), Permits::new(), false);
    bus(&desk).outgoing(Instant::ZERO, |_| Taken::Never(Undelivered::TooLong));
    assert_eq!(now(turn.outcome()), Err(Undelivered::TooLong));
    // Nobody's frame is on the line.
    bus(&desk).posted(Ok(()));
    assert_eq!(now(turn.outcome()), Err(Undelivered::TooLong));
}

/// Of the frames of a bus, only those of the framed one that clients use.
#[test]
fn another_bus_is_shown_nothing() {
    let desk = desk();
    let _turn = put(&desk, 1, &frame(9, 17), Permits::new(), false);
    let other = BusImage { bus: 1, ..bus(&desk) };
    other.outgoing(Instant::ZERO, |_| panic!("shown"));
}

#[test]
fn nothing_that_moves_goes_after_a_stop() {
    let desk = desk();
    let mine = Holder::Connection(1);
    let permit = desk.lease(Instant::ZERO, 0, mine, None).expect("a lease");
    let permits: Permits = [permit].into_iter().collect();
    let mut turn = put(&desk, 1, &frame(9, 17), permits.clone(), false);
    desk.revoke_permits(Instant::ZERO, 0, Holder::Connection(2));
    assert_eq!(shown(&desk), None);
    assert_eq!(now(turn.outcome()), Err(Undelivered::Stopped));
    drop(turn);
    // A permit without a lease is none.
    let mut turn = put(&desk, 1, &frame(9, 17), permits, false);
    assert_eq!(shown(&desk), None);
    assert_eq!(now(turn.outcome()), Err(Undelivered::Stopped));
}

#[test]
fn what_its_client_does_not_wait_for_is_not_sent_but_a_stop_is() {
    let desk = desk();
    drop(put(&desk, 1, &frame(9, 17), Permits::new(), false));
    assert_eq!(shown(&desk), None);
    drop(put(&desk, 1, &frame(9, 17), Permits::new(), true));
    let mut next = pin!(desk.turn(2));
    assert!(poll(next.as_mut()).is_pending());
    assert!(shown(&desk).is_some());
    assert!(poll(next.as_mut()).is_pending());
    bus(&desk).posted(Ok(()));
    assert!(poll(next).is_ready());
}

#[test]
fn a_frame_on_the_line_keeps_the_place_whoever_goes() {
    let desk = desk();
    let turn = put(&desk, 1, &frame(9, 17), Permits::new(), false);
    assert!(shown(&desk).is_some());
    drop(turn);
    let mut next = pin!(desk.turn(2));
    assert!(poll(next.as_mut()).is_pending());
    bus(&desk).posted(Ok(()));
    assert!(poll(next).is_ready());
}

#[test]
fn each_client_gets_what_is_for_an_address_of_its_own() {
    let desk = desk();
    let (mut one, mut two) = (desk.follow_bus(1), desk.follow_bus(2));
    one.answer_to(9);
    two.answer_to(10);
    let mut buffer = [0; MAX_FRAME];
    bus(&desk).heard(&frame(17, 11));
    bus(&desk).heard(&frame(17, 10));
    assert!(poll(pin!(one.heard())).is_pending());
    assert!(poll(pin!(two.heard())).is_ready());
    assert_eq!(two.read(&mut buffer), Some(Ok(frame(17, 10).len())));
    assert_eq!(buffer[..frame(17, 10).len()], frame(17, 10)[..]);
    // What one sends to the other is heard as well.
    let _turn = put(&desk, 2, &frame(10, 9), Permits::new(), false);
    assert!(shown(&desk).is_some());
    bus(&desk).posted(Ok(()));
    assert!(poll(pin!(one.heard())).is_ready());
    assert_eq!(one.read(&mut buffer), Some(Ok(frame(10, 9).len())));
    assert!(poll(pin!(one.heard())).is_pending());
    assert_eq!(desk.mail_statistics().heard, 2, "that for 11 is for nobody");
}

#[test]
fn who_is_too_slow_is_told() {
    let desk = desk();
    let mut slow = desk.follow_bus(1);
    slow.answer_to(9);
    let one = frame(17, 9);
    let room = crate::port::limits::HEARD / (one.len() + 2);
    for _ in 0..room + 3 {
        bus(&desk).heard(&one);
    }
    let mut buffer = [0; MAX_FRAME];
    assert!(poll(pin!(slow.heard())).is_ready());
    assert_eq!(slow.read(&mut buffer), Some(Err(NonZeroU32::new(3).expect("three"))));
    assert_eq!(slow.read(&mut buffer), Some(Ok(one.len())));
    assert_eq!(desk.mail_statistics().lost, 3);
}
