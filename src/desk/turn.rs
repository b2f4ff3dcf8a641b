//! A place that clients use in turn, in the order in which they came: what goes out there is one at a time, and who puts
//! something there keeps the place until it knows what has become of it.

use core::future::poll_fn;
use core::task::Poll;

use heapless::{Deque, Vec};
use puente_line::Instant;

use super::lease::AxisLease;
use super::seats::Seats;
use super::{Desk, Permit, State};
use crate::port::limits::{AXES, SLOTS};

/// What something needs in order to go: one for each axis that it moves.
pub type Permits = Vec<Permit, AXES>;

/// What the place is used for. `T` is what may become of what goes out.
#[derive(Clone, Copy)]
enum Phase<T> {
    Free,
    /// Whose turn it is writes.
    Writing,
    /// It waits for the pump.
    Ready(Sender),
    /// The pump has it.
    Sending(Sender),
    /// What has become of it.
    Ended(T),
}

/// Who sends: nobody where its client is gone.
#[derive(Clone, Copy)]
struct Sender {
    seat: Option<u8>,
    /// It stops axes, and moves none: it goes even where its client is gone.
    stop: bool,
}

impl<T> Phase<T> {
    fn is_free(&self) -> bool {
        matches!(self, Phase::Free)
    }
}

/// The place.
pub(super) struct Place<T> {
    /// Who waits for it, by seat.
    queue: Deque<u8, SLOTS>,
    phase: Phase<T>,
    permits: Permits,
}

impl<T: Copy> Place<T> {
    pub(super) const fn new() -> Self {
        Self { queue: Deque::new(), phase: Phase::Free, permits: Vec::new() }
    }

    /// The place is free for the next one.
    fn free(&mut self, seats: &mut Seats) {
        self.phase = Phase::Free;
        if let Some(seat) = self.queue.front().copied() {
            seats.wake(seat);
        }
    }

    /// What has become of what the pump has; false where it has nothing.
    pub(super) fn end(&mut self, seats: &mut Seats, outcome: T) -> bool {
        let Phase::Sending(sender) = self.phase else { return false };
        match sender.seat {
            Some(seat) => {
                self.phase = Phase::Ended(outcome);
                seats.wake(seat);
            }
            None => self.free(seats),
        }
        true
    }

    /// Hands what waits to the pump, if there is something: whether all permits hold.
    pub(super) fn take(&mut self, leases: &[AxisLease], now: Instant) -> Option<bool> {
        let Phase::Ready(sender) = self.phase else { return None };
        self.phase = Phase::Sending(sender);
        Some(self.permits.iter().all(|permit| permit.commands(leases, now)))
    }

    /// The pump could not use it yet.
    pub(super) fn give_back(&mut self, seats: &mut Seats) {
        if let Phase::Sending(sender) = self.phase {
            if sender.seat.is_some() || sender.stop {
                self.phase = Phase::Ready(sender);
            } else {
                self.free(seats);
            }
        }
    }

    /// The pump has it again to take, though its client is gone.
    pub(super) fn put_back(&mut self) {
        if let Phase::Sending(sender) = self.phase {
            self.phase = Phase::Ready(sender);
        }
    }

    /// Whether the pump has it.
    pub(super) fn is_sending(&self) -> bool {
        matches!(self.phase, Phase::Sending(_))
    }

    /// Whether the pump has something whose client is gone.
    pub(super) fn is_abandoned(&self) -> bool {
        matches!(self.phase, Phase::Sending(Sender { seat: None, .. }))
    }

    /// Whose it is that the pump has.
    pub(super) fn sender(&self) -> Option<u8> {
        match self.phase {
            Phase::Sending(sender) => sender.seat,
            _ => None,
        }
    }
}

/// Which place.
pub(super) trait Which: Copy {
    /// What may become of what goes out there.
    type Outcome: Copy;

    /// The place, and whom it wakes; none where there is no such bus.
    fn place(self, state: &mut State) -> Option<(&mut Place<Self::Outcome>, &mut Seats)>;

    /// The bus behind it.
    fn bus(self, state: &State) -> Option<u8>;
}

impl Desk {
    /// Waits for the turn of the client of a seat at a place, for ever where there is none: whoever came before goes first.
    pub(super) async fn turn_at<W: Which>(&self, which: W, seat: u8) -> Turn<'_, W> {
        let waiting = Waiting { desk: self, which, seat };
        self.with(|state| {
            if let Some((place, _)) = which.place(state) {
                // There is room: a seat has one client, and a client waits once.
                let _ = place.queue.push_back(seat);
            }
        });
        poll_fn(|context| {
            self.with(|state| {
                let Some((place, seats)) = which.place(state) else { return Poll::Pending };
                if place.phase.is_free() && place.queue.front() == Some(&seat) {
                    place.phase = Phase::Writing;
                    return Poll::Ready(());
                }
                seats.register(seat, context.waker());
                Poll::Pending
            })
        })
        .await;
        // It is not in the queue any more, and nobody has to be woken for that.
        drop(waiting);
        Turn { desk: self, which, seat }
    }
}

/// A place in the queue.
struct Waiting<'d, W: Which> {
    desk: &'d Desk,
    which: W,
    seat: u8,
}

impl<W: Which> Drop for Waiting<'_, W> {
    fn drop(&mut self) {
        self.desk.with(|state| {
            let Some((place, seats)) = self.which.place(state) else { return };
            let next = place.queue.front() == Some(&self.seat);
            place.queue.retain(|seat| *seat != self.seat);
            if next && place.phase.is_free() {
                // Its waker may have been told already, and will not look any more.
                place.free(seats);
            }
        });
    }
}

/// A client's turn. The next client's begins when it is dropped. Then what the pump has not taken is forgotten, except
/// what stops axes.
pub(super) struct Turn<'d, W: Which> {
    pub(super) desk: &'d Desk,
    which: W,
    seat: u8,
}

impl<W: Which> Turn<'_, W> {
    /// Gives it to the pump, which sends it while all permits hold; `stop` where it stops axes and moves none.
    pub(super) fn send(&mut self, permits: Permits, stop: bool) {
        let bus = self.desk.with(|state| {
            let (place, _) = self.which.place(state)?;
            place.permits = permits;
            place.phase = Phase::Ready(Sender { seat: Some(self.seat), stop });
            self.which.bus(state)
        });
        self.desk.work(bus);
    }

    /// Waits until it is known what has become of it.
    pub(super) async fn outcome(&mut self) -> W::Outcome {
        let (which, seat) = (self.which, self.seat);
        poll_fn(|context| {
            self.desk.with(|state| {
                let Some((place, seats)) = which.place(state) else { return Poll::Pending };
                if let Phase::Ended(outcome) = place.phase {
                    return Poll::Ready(outcome);
                }
                seats.register(seat, context.waker());
                Poll::Pending
            })
        })
        .await
    }
}

impl<W: Which> Drop for Turn<'_, W> {
    fn drop(&mut self) {
        let abandoned = self.desk.with(|state| {
            let (place, seats) = self.which.place(state)?;
            match &mut place.phase {
                Phase::Sending(sender) => {
                    sender.seat = None;
                    return self.which.bus(state);
                }
                Phase::Ready(sender) if sender.stop => sender.seat = None,
                Phase::Free | Phase::Writing | Phase::Ready(_) | Phase::Ended(..) => place.free(seats),
            }
            None
        });
        if abandoned.is_some() {
            self.desk.work(abandoned);
        }
    }
}
