//! The simulated cell as a serial line.

use std::cell::RefCell;

use embassy_futures::select::select;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use puente_cell::Cell;

use crate::clock;

/// The gateway's end of the simulated line.
pub(super) struct Sim {
    cell: RefCell<Cell>,
    /// Bytes of the line that did not fit the last read.
    rest: RefCell<Vec<u8>>,
    /// Something was written, so that the cell may have something to say earlier.
    written: Signal<NoopRawMutex, ()>,
}

impl Sim {
    pub(super) fn new(config: puente_cell::Config) -> Self {
        Self { cell: RefCell::new(Cell::new(config)), rest: RefCell::default(), written: Signal::new() }
    }

    pub(super) async fn read(&self, buffer: &mut [u8]) -> usize {
        while self.rest.borrow().is_empty() {
            let (said, next) = {
                let mut cell = self.cell.borrow_mut();
                (cell.poll(clock::now()), cell.poll_at())
            };
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
        self.cell.borrow_mut().receive(clock::now(), bytes);
        self.written.signal(());
        bytes.len()
    }
}
