//! What the interrupts of a controller and its bus task share.

use core::cell::RefCell;
use core::task::{Context, Poll};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::AtomicWaker;
use heapless::Deque;
use puente_canopen::{Frame, Id};

use super::controller::Controller;
use crate::port::can::mailboxes::{MAILBOXES, mailbox};
use crate::port::{CanCounters, CanEvent, CanState, NotTaken};

/// Frames received and not yet read: 3 ms of a full bus at 1 Mbit/s.
const RECEIVE: usize = 32;

pub(super) struct Shared {
    inner: Mutex<CriticalSectionRawMutex, RefCell<Inner>>,
    reader: AtomicWaker,
    writer: AtomicWaker,
}

struct Inner {
    received: Deque<Frame, RECEIVE>,
    /// Frames that were not kept, and have not been told.
    lost: u32,
    state: CanState,
    /// It has not been told.
    changed: bool,
    bus_offs: u32,
    all_lost: u32,
    /// What is in the mailboxes.
    waiting: [Option<Id>; MAILBOXES],
}

impl Inner {
    fn lose(&mut self) {
        self.lost = self.lost.saturating_add(1);
        self.all_lost = self.all_lost.saturating_add(1);
    }

    /// Takes what there is from the controller, and sees how it is.
    fn look(&mut self, controller: Controller) {
        while let Some(frame) = controller.receive() {
            if self.received.push_back(frame).is_err() {
                self.lose();
            }
        }
        if controller.take_overrun() {
            self.lose();
        }
        let state = controller.state();
        if state != self.state {
            self.state = state;
            self.changed = true;
            if state == CanState::Off {
                self.bus_offs = self.bus_offs.saturating_add(1);
                // Nobody wants to say afterwards what was to be said before.
                controller.abort();
            }
        }
        for (mailbox, waits) in (0..).zip(&mut self.waiting) {
            if !controller.is_pending(mailbox) {
                *waits = None;
            }
        }
    }
}

impl Shared {
    pub(super) const fn new() -> Self {
        let inner = Inner {
            received: Deque::new(),
            lost: 0,
            state: CanState::Down,
            changed: false,
            bus_offs: 0,
            all_lost: 0,
            waiting: [None; MAILBOXES],
        };
        Self {
            inner: Mutex::new(RefCell::new(inner)),
            reader: AtomicWaker::new(),
            writer: AtomicWaker::new(),
        }
    }

    fn with<R>(&self, f: impl FnOnce(&mut Inner) -> R) -> R {
        self.inner.lock(|inner| f(&mut inner.borrow_mut()))
    }

    /// Something has happened: in an interrupt, or because it is time to see.
    pub(super) fn look(&self, controller: Controller) {
        self.with(|inner| inner.look(controller));
        self.reader.wake();
        self.writer.wake();
    }

    pub(super) fn state(&self) -> CanState {
        self.with(|inner| inner.state)
    }

    pub(super) fn counters(&self) -> CanCounters {
        self.with(|inner| CanCounters {
            bus_offs: inner.bus_offs,
            lost: inner.all_lost,
            ..CanCounters::default()
        })
    }

    pub(super) fn poll_event(&self, context: &Context<'_>) -> Poll<CanEvent> {
        self.reader.register(context.waker());
        self.with(|inner| {
            if core::mem::take(&mut inner.changed) {
                return Poll::Ready(CanEvent::State(inner.state));
            }
            if let Some(frame) = inner.received.pop_front() {
                return Poll::Ready(CanEvent::Frame(frame));
            }
            match core::mem::take(&mut inner.lost) {
                0 => Poll::Pending,
                lost => Poll::Ready(CanEvent::Lost(lost)),
            }
        })
    }

    pub(super) fn poll_send(
        &self,
        context: &Context<'_>,
        controller: Controller,
        frame: &Frame,
    ) -> Poll<Result<(), NotTaken>> {
        self.writer.register(context.waker());
        self.with(|inner| {
            inner.look(controller);
            if !inner.state.sends() {
                return Poll::Ready(Err(NotTaken(inner.state)));
            }
            let Some(mailbox) = mailbox(&inner.waiting, frame.id()) else { return Poll::Pending };
            controller.send(mailbox, frame);
            if let Some(waits) = inner.waiting.get_mut(mailbox) {
                *waits = Some(frame.id());
            }
            Poll::Ready(Ok(()))
        })
    }
}
