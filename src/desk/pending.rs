//! A request on its way: a future that gives the request up when it is dropped.

use core::future::Future;
use core::pin::Pin;
use core::task::{Context, Poll};

use super::{Answer, Desk};
use crate::bus::Ticket;

/// Resolves to the [`Answer`]. Dropped before that, a request still in the queue is never sent; one on the wire runs
/// its course and nobody hears of it.
pub struct Pending<'d> {
    desk: &'d Desk,
    ticket: Option<Ticket>,
}

impl<'d> Pending<'d> {
    pub(super) fn new(desk: &'d Desk, ticket: Ticket) -> Self {
        Self { desk, ticket: Some(ticket) }
    }
}

impl Future for Pending<'_> {
    type Output = Answer;

    fn poll(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Answer> {
        let Some(ticket) = self.ticket else {
            return Poll::Pending;
        };
        let answer = self.desk.with(|state| state.queue.collect(ticket, context.waker()));
        match answer {
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
