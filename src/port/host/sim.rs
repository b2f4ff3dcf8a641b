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
    Framed(Box<framed::Cell>),
}

impl Sim {
    pub(super) fn new(simulation: &Simulation) -> io::Result<Self> {
        let cell = match simulation.clone() {
            Simulation::Modbus(config) => Kind::Modbus(Box::new(Cell::new(config))),
            Simulation::Framed(config) => {
                let cell = framed::Cell::new(config).map_err(|error| io::Error::other(error.to_string()))?;
                Kind::Framed(Box::new(cell))
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
            Kind::Framed(cell) => cell.receive(0, now, bytes),
        }
        self.written.signal(());
        bytes.len()
    }

    /// Drops what is not on the line yet, of a framed one.
    pub(super) fn discard(&self) {
        if let Kind::Framed(cell) = &mut *self.cell.borrow_mut() {
            cell.discard(0, clock::now());
        }
    }

    /// Whether a character is arriving, of a framed line.
    pub(super) fn carrier(&self) -> bool {
        match &mut *self.cell.borrow_mut() {
            Kind::Modbus(_) => false,
            Kind::Framed(cell) => cell.carrier(0, clock::now()),
        }
    }
}

impl Kind {
    /// What has been on the line, and when to ask again.
    fn poll(&mut self, now: Instant) -> (Option<Vec<u8>>, Option<Instant>) {
        match self {
            Self::Modbus(cell) => (cell.poll(now), cell.poll_at()),
            Self::Framed(cell) => (cell.poll(0, now), cell.poll_at().map(|at| at.max(now + REST))),
        }
    }
}
