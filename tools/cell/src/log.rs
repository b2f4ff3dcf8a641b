//! What was on the line, and when.

use std::collections::VecDeque;

use puente_line::Instant;
use puente_modbus::FrameError;

/// Events that are kept; the oldest go first.
const CAPACITY: usize = 4_096;

/// Something that was on the line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A request with a right check, to a drive of the cell or not.
    Request {
        /// Address, 0 for a broadcast.
        unit: u8,
        /// Function code and data.
        pdu: Vec<u8>,
    },
    /// Bytes that were no frame.
    NoFrame(FrameError),
    /// What a drive sent, all bytes as on the line, faults included.
    Reply(Vec<u8>),
}

/// The last events, each with the moment of its last byte.
#[derive(Debug, Default)]
pub(crate) struct Log(VecDeque<(Instant, Event)>);

impl Log {
    pub fn push(&mut self, at: Instant, event: Event) {
        if self.0.len() == CAPACITY {
            self.0.pop_front();
        }
        self.0.push_back((at, event));
    }

    pub fn iter(&self) -> impl Iterator<Item = &(Instant, Event)> {
        self.0.iter()
    }

    pub fn take(&mut self) -> impl Iterator<Item = (Instant, Event)> + use<> {
        std::mem::take(&mut self.0).into_iter()
    }
}
