//! The simulated cell as a serial line.

use std::cell::RefCell;
use std::io;

use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use puente_cell::{Cell, framed};
use puente_line::{Duration, Instant};

use crate::clock;

/// A framed line is looked at no more often than this, unless somebody else wakes the reader: then it has heard all there
/// is first.
const REST: Duration = Duration::from_micros(200);

/// A framed line that is looked at later than this stands still for what is above it: a PC that is held up does not tell
/// in time that its simulation waits, and the modules' supervision would take that for the death of the gateway.
const STALL: Duration = Duration::from_millis(20);

/// What is simulated.
#[derive(Clone, Debug)]
pub enum Simulation {
    /// Drives on a Modbus line.
    Modbus(puente_cell::Config),
    /// Modules on a framed line, on whose only port the gateway is.
    Framed(framed::Config),
}

/// The gateway's end of the simulated line.
pub(super) struct Sim {
    cell: RefCell<Kind>,
    /// Bytes of the line that did not fit the last read.
    rest: RefCell<Vec<u8>>,
    /// Something was written, so that the cell may have something to say earlier.
    written: Signal<NoopRawMutex, ()>,
}

enum Kind {
    Modbus(Box<Cell>),
    Framed(Box<framed::Cell>, Course),
}

/// The time of a simulation that stands still where its PC is held up.
#[derive(Default)]
pub(super) struct Course {
    /// When it was to be looked at, by its own time.
    due: Instant,
    /// How long it has stood still.
    stood: Duration,
}

impl Course {
    /// Its time begins now.
    pub(super) fn starting_at(now: Instant) -> Self {
        Self { due: Instant::ZERO, stood: now.since(Instant::ZERO) }
    }

    /// Its own time.
    pub(super) fn now(&mut self, now: Instant) -> Instant {
        let own = Instant::ZERO + now.since(Instant::ZERO + self.stood);
        let late = own.since(self.due);
        if late <= STALL {
            return own;
        }
        self.stood += late - STALL;
        self.due + STALL
    }

    /// It is to be looked at, at the latest, at a moment of its own time that is `rest` after `own` or later: when that is.
    pub(super) fn look_at(&mut self, own: Instant, next: Option<Instant>, rest: Duration) -> Option<Instant> {
        let next = next.map(|next| next.max(own + rest));
        self.due = next.unwrap_or(own);
        next.map(|next| next + self.stood)
    }
}

impl Sim {
    pub(super) fn new(simulation: &Simulation) -> io::Result<Self> {
        let cell = match simulation.clone() {
            Simulation::Modbus(config) => Kind::Modbus(Box::new(Cell::new(config))),
            Simulation::Framed(config) => {
                let cell = framed::Cell::new(config).map_err(|error| io::Error::other(error.to_string()))?;
                Kind::Framed(Box::new(cell), Course::starting_at(clock::now()))
            }
        };
        Ok(Self { cell: RefCell::new(cell), rest: RefCell::default(), written: Signal::new() })
    }

    pub(super) async fn read(&self, buffer: &mut [u8]) -> usize {
        while self.rest.borrow().is_empty() {
            let (said, next) = self.cell.borrow_mut().poll(clock::now());
            match said {
                Some(bytes) => *self.rest.borrow_mut() = bytes,
                None => {
                    select(clock::at(next), self.written.wait()).await;
                }
            }
        }
        let mut rest = self.rest.borrow_mut();
        let count = rest.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(rest.drain(..count)) {
            *to = from;
        }
        count
    }

    pub(super) fn write(&self, bytes: &[u8]) -> usize {
        let now = clock::now();
        match &mut *self.cell.borrow_mut() {
            Kind::Modbus(cell) => cell.receive(now, bytes),
            Kind::Framed(cell, course) => cell.receive(0, course.now(now), bytes),
        }
        self.written.signal(());
        bytes.len()
    }

    /// Drops what is not on the line yet, of a framed one.
    pub(super) fn discard(&self) {
        if let Kind::Framed(cell, course) = &mut *self.cell.borrow_mut() {
            cell.discard(0, course.now(clock::now()));
        }
    }

    /// Whether a character is arriving, of a framed line.
    pub(super) fn carrier(&self) -> bool {
        match &mut *self.cell.borrow_mut() {
            Kind::Modbus(_) => false,
            Kind::Framed(cell, course) => cell.carrier(0, course.now(clock::now())),
        }
    }
}

impl Kind {
    /// What has been on the line, and when to ask again.
    fn poll(&mut self, now: Instant) -> (Option<Vec<u8>>, Option<Instant>) {
        match self {
            Self::Modbus(cell) => (cell.poll(now), cell.poll_at()),
            Self::Framed(cell, course) => {
                let own = course.now(now);
                (cell.poll(0, own), course.look_at(own, cell.poll_at(), REST))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn at(millis: u64) -> Instant {
        Instant::from_millis(millis)
    }

    #[test]
    fn a_simulation_stands_still_where_its_pc_is_held_up() {
        let mut course = Course::default();
        assert_eq!(course.now(at(5)), at(5), "in time");
        assert_eq!(course.look_at(at(5), Some(at(10)), REST), Some(at(10)));
        assert_eq!(course.now(at(30)), at(30), "late, as any PC is now and then");
        assert_eq!(course.look_at(at(30), Some(at(31)), REST), Some(at(31)));
        assert_eq!(course.now(at(200)), at(51), "held up");
        assert_eq!(course.now(at(201)), at(51), "the same, before anything was done about it");
        assert_eq!(course.look_at(at(51), Some(at(52)), REST), Some(at(202)), "by the clock of the PC");
        assert_eq!(course.now(at(203)), at(53), "it goes on from there");
    }
}
