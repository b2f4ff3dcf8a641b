//! A request on its way: a future that gives the request up when it is dropped.

use core::future::poll_fn;
use core::task::{Context, Poll};

use super::{Desk, Failure};
use crate::bus::Ticket;

/// A request on its way. Dropped before its answer was taken, a request still in the queue is never sent, except a
/// stop; one on the wire runs its course. Nobody hears of either.
pub struct Pending<'d> {
    desk: &'d Desk,
    ticket: Option<Ticket>,
}

impl<'d> Pending<'d> {
    pub(super) fn new(desk: &'d Desk, ticket: Ticket) -> Self {
        Self { desk, ticket: Some(ticket) }
    }

    /// Waits for the answer and takes what `f` makes of it: the reply PDU stays where it is, which saves its waiting
    /// owner the room. The answer is taken once.
    pub async fn answer<T>(&mut self, mut f: impl FnMut(Result<&[u8], Failure>) -> T) -> T {
        poll_fn(|context| self.poll_answer(context, &mut f)).await
    }

    /// The same, for those who poll several.
    pub fn poll_answer<T>(
        &mut self,
        context: &mut Context<'_>,
        f: impl FnOnce(Result<&[u8], Failure>) -> T,
    ) -> Poll<T> {
        let Some(ticket) = self.ticket else {
            return Poll::Pending;
        };
        match self.desk.with(|state| state.queue.collect(ticket, context.waker(), f)) {
            Some(answer) => {
                self.ticket = None;
                Poll::Ready(answer)
            }
            None => Poll::Pending,
        }
    }
}

impl Drop for Pending<'_> {
    fn drop(&mut self) {
        if let Some(ticket) = self.ticket {
            self.desk.with(|state| state.queue.give_up(ticket));
        }
    }
}
