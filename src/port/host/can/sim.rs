//! The simulated cell as a CAN bus: the gateway is at its port 0.

use std::cell::{Cell as Plain, RefCell};

use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use puente_canopen::Frame;
use puente_cell::can::bus::State;
use puente_cell::can::{Cell, Config};
use puente_line::{Duration, Instant};

use crate::clock;
use crate::port::host::sim::Course;
use crate::port::{CanCounters, CanEvent, CanState, NotTaken};

/// The bus is looked at no more often than this, unless a frame is sent.
const REST: Duration = Duration::from_micros(20);
/// Frames that wait for the bus at once, as in a controller's mailboxes.
const ROOM: usize = 3;

/// The gateway's end of the simulated bus.
pub(super) struct Sim {
    inner: RefCell<(Cell, Course)>,
    /// What the reader knows.
    told: Plain<CanState>,
    /// A frame was sent, so that something may happen earlier.
    sent: Signal<NoopRawMutex, ()>,
}

impl Sim {
    pub(super) fn new(config: Config) -> Self {
        let cell = Cell::new(config);
        Self {
            inner: RefCell::new((cell, Course::starting_at(clock::now()))),
            told: Plain::new(CanState::Down),
            sent: Signal::new(),
        }
    }

    pub(super) async fn read(&self) -> CanEvent {
        loop {
            let next = {
                let (cell, course) = &mut *self.inner.borrow_mut();
                let own = course.now(clock::now());
                cell.run(own);
                let state = state(cell);
                if self.told.replace(state) != state {
                    return CanEvent::State(state);
                }
                if let Some(frame) = cell.poll(own, 0) {
                    return CanEvent::Frame(frame);
                }
                look_at(cell, course, own)
            };
            select(clock::at(next), self.sent.wait()).await;
        }
    }

    pub(super) async fn write(&self, frame: &Frame) -> Result<(), NotTaken> {
        loop {
            let next = {
                let (cell, course) = &mut *self.inner.borrow_mut();
                let own = course.now(clock::now());
                cell.run(own);
                if state(cell) == CanState::Off {
                    return Err(NotTaken(CanState::Off));
                }
                if cell.pending(0) < ROOM {
                    cell.send(own, 0, frame);
                    self.sent.signal(());
                    return Ok(());
                }
                look_at(cell, course, own)
            };
            clock::at(next).await;
        }
    }

    pub(super) fn discard(&self) {
        self.inner.borrow_mut().0.discard(0);
    }

    pub(super) fn counters(&self) -> CanCounters {
        let counters = self.inner.borrow().0.counters(0);
        let small = |errors: u16| u8::try_from(errors).unwrap_or(u8::MAX);
        CanCounters {
            tx_errors: small(counters.transmit()),
            rx_errors: small(counters.receive()),
            bus_offs: counters.bus_offs(),
            lost: 0,
        }
    }
}

fn look_at(cell: &Cell, course: &mut Course, own: Instant) -> Option<Instant> {
    course.look_at(own, cell.poll_at(), REST)
}

fn state(cell: &Cell) -> CanState {
    match cell.counters(0).state() {
        State::Active => CanState::Active,
        State::Warning => CanState::Warning,
        State::Passive => CanState::Passive,
        State::Off => CanState::Off,
    }
}
