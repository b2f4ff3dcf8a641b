//! Taking turns at the outgoing place.

use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::MutexGuard;

use super::{Frame, Permits, Phase, Sender};
use crate::bus::Undelivered;
use crate::desk::Desk;

impl Desk {
    /// Waits for the turn of the client of a seat to send a frame: whoever came before goes first.
    pub async fn turn(&self, seat: u8) -> Turn<'_> {
        let waiting = Waiting { desk: self, seat };
        self.with(|state| {
            // There is room: a seat has one client, and a client waits once.
            let _ = state.mail.queue.push_back(seat);
        });
        poll_fn(|context| {
            self.with(|state| {
                let mail = &mut state.mail;
                if mail.phase == Phase::Free && mail.queue.front() == Some(&seat) {
                    mail.phase = Phase::Writing(seat);
                    return Poll::Ready(());
                }
                mail.register(seat, context.waker());
                Poll::Pending
            })
        })
        .await;
        // It is not in the queue any more, and nobody has to be woken for that.
        drop(waiting);
        Turn { desk: self, seat }
    }
}

/// A place in the queue.
struct Waiting<'d> {
    desk: &'d Desk,
    seat: u8,
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.desk.with(|state| {
            let mail = &mut state.mail;
            let next = mail.queue.front() == Some(&self.seat);
            mail.queue.retain(|seat| *seat != self.seat);
            if next && mail.phase == Phase::Free {
                // Its waker may have been told already, and will not look any more.
                mail.free();
            }
        });
    }
}

/// A client's turn. The next client's begins when it is dropped. Then a frame that has not been taken for the line is
/// forgotten, except one that stops axes.
pub struct Turn<'d> {
    desk: &'d Desk,
    seat: u8,
}

impl Turn<'_> {
    /// The place for the frame. To be let go before the frame is sent.
    pub async fn frame(&self) -> MutexGuard<'_, CriticalSectionRawMutex, Frame> {
        self.desk.outgoing.lock().await
    }

    /// Gives the frame to the bus, which sends it while all permits hold; `stop` where it stops axes and moves none.
    pub fn send(&mut self, permits: Permits, stop: bool) {
        let bus = self.desk.with(|state| {
            state.mail.permits = permits;
            state.mail.phase = Phase::Ready(Sender { seat: Some(self.seat), stop });
            state.mail.bus
        });
        if let Some(signal) = bus.and_then(|bus| self.desk.work.get(usize::from(bus))) {
            signal.signal(());
        }
    }

    /// Waits until the frame has been on the line, or never will.
    pub async fn outcome(&mut self) -> Result<(), Undelivered> {
        let seat = self.seat;
        poll_fn(|context| {
            self.desk.with(|state| {
                if let Phase::Ended(_, outcome) = state.mail.phase {
                    return Poll::Ready(outcome);
                }
                state.mail.register(seat, context.waker());
                Poll::Pending
            })
        })
        .await
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.desk.with(|state| {
            let mail = &mut state.mail;
            match &mut mail.phase {
                Phase::Sending(sender) => sender.seat = None,
                Phase::Ready(sender) if sender.stop => sender.seat = None,
                Phase::Free | Phase::Writing(_) | Phase::Ready(_) | Phase::Ended(..) => mail.free(),
            }
        });
    }
}
