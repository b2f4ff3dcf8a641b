//! The simulated cell as a serial line.

use puente_cell::Cell;

use crate::clock;

/// The gateway's end of the simulated line.
pub(super) struct Sim {
    cell: Cell,
    /// Bytes of the line that did not fit the last read.
    rest: Vec<u8>,
}

impl Sim {
    pub(super) fn new(config: puente_cell::Config) -> Self {
        Self { cell: Cell::new(config), rest: Vec::new() }
    }

    pub(super) async fn read(&mut self, buffer: &mut [u8]) -> usize {
        while self.rest.is_empty() {
            match self.cell.poll(clock::now()) {
                Some(bytes) => self.rest = bytes,
                None => clock::at(self.cell.poll_at()).await,
            }
        }
        let count = self.rest.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(self.rest.drain(..count)) {
            *to = from;
        }
        count
    }

    pub(super) fn write(&mut self, bytes: &[u8]) {
        self.cell.receive(clock::now(), bytes);
    }
}
