//! Writing.

use heapless::Vec;

use super::super::segment::padded;
use super::super::{Abort, BlockSegment, Initiate, Request, Response, SEGMENT, Segment, crc};
use super::work::{Next, Step};
use super::{Counters, Failure, MAX_BLOCK, Outcome};
use crate::Address;

/// What is sent next, or what was sent last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Initiate,
    /// A plain segment.
    Segment {
        toggle: bool,
    },
    InitiateBlock,
    /// The next segment of a block.
    Block,
    /// The whole block is out.
    Acknowledgement,
    /// It is, and its last segment has been repeated.
    Probe {
        /// Not for the first time.
        again: bool,
    },
    /// The whole last block is out, and the end of the transfer, for the acknowledgement may be lost.
    ProbeEnd {
        /// Not for the first time.
        again: bool,
    },
    /// The end of a block transfer.
    End {
        /// Not for the first time.
        repeated: bool,
    },
}

/// A download, plain or in blocks.
#[derive(Clone, Debug)]
pub(super) struct Download {
    phase: Phase,
    size: u32,
    /// Bytes that are confirmed; in a block transfer, where the block begins.
    confirmed: u32,
    /// Segments that the server takes in a block.
    block: u8,
    /// Segments sent of this block.
    sent: u8,
    /// The message that follows has these bytes.
    supplied: Option<Vec<u8, SEGMENT>>,
    /// The CRC over the first bytes, and how many they are.
    crc: (u16, u32),
    /// The server checks it.
    checks: bool,
    /// Whether an acknowledgement was lost could not be told; the CRC will tell.
    unsure: bool,
}

impl Download {
    pub const fn new(size: u32, block: bool) -> Self {
        Self {
            phase: if block { Phase::InitiateBlock } else { Phase::Initiate },
            size,
            confirmed: 0,
            block: 0,
            sent: 0,
            supplied: None,
            crc: (0, 0),
            checks: false,
            unsure: false,
        }
    }

    pub const fn is_block(&self) -> bool {
        !matches!(self.phase, Phase::Initiate | Phase::Segment { .. })
    }

    /// Whether more follows without a response.
    pub const fn is_sending(&self) -> bool {
        matches!(self.phase, Phase::Block)
    }

    /// What it means that the server aborts with `code`, having said `heard` before.
    pub const fn aborted(&self, code: Abort, heard: Option<u8>) -> Failure {
        match self.phase {
            // It may not have understood the end because it had understood the one before.
            Phase::End { repeated: true } => Failure::Timeout { heard },
            _ if self.unsure => Failure::Position,
            _ => Failure::Aborted(code),
        }
    }

    /// Where the bytes of the next message begin, and how many they are.
    fn wanted(&self) -> (u32, usize) {
        let before = match self.phase {
            Phase::Block => u32::from(self.sent),
            Phase::Acknowledgement | Phase::Probe { .. } => u32::from(self.sent.saturating_sub(1)),
            _ => 0,
        };
        let offset = self.confirmed.saturating_add(before * SEGMENT as u32);
        let room = if self.phase == Phase::Initiate { 4 } else { SEGMENT as u32 };
        (offset, self.size.saturating_sub(offset).min(room) as usize)
    }

    /// False where they are too few.
    pub fn supply(&mut self, bytes: &[u8]) -> bool {
        let (offset, count) = self.wanted();
        let Some(bytes) = bytes.get(..count) else {
            return false;
        };
        if self.is_block() && self.crc.1 == offset {
            self.crc = (crc(self.crc.0, bytes), offset.saturating_add(count as u32));
        }
        self.supplied = Vec::from_slice(bytes).ok();
        true
    }

    /// The bytes of the next message, or that they are lacking; none where it has none.
    fn take_supplied(&mut self) -> Result<Vec<u8, SEGMENT>, Next> {
        let (offset, count) = self.wanted();
        match self.supplied.take() {
            Some(bytes) => Ok(bytes),
            None if count == 0 => Ok(Vec::new()),
            None => Err(Next::Fetch { offset, count }),
        }
    }

    pub fn next(&mut self, address: Address) -> Next {
        self.message(address).unwrap_or_else(|fetch| fetch)
    }

    fn message(&mut self, address: Address) -> Result<Next, Next> {
        Ok(match self.phase {
            Phase::Initiate if matches!(self.size, 1..=4) => {
                let bytes = self.take_supplied()?;
                let data = Initiate::Expedited(bytes.into_iter().collect());
                Next::Message(Request::InitiateDownload { address, data })
            }
            Phase::Initiate => {
                let data = Initiate::Segmented { size: Some(self.size) };
                Next::Message(Request::InitiateDownload { address, data })
            }
            Phase::Segment { toggle } => {
                let data = self.take_supplied()?;
                let last = self.confirmed.saturating_add(data.len() as u32) >= self.size;
                Next::Message(Request::DownloadSegment(Segment { toggle, last, data }))
            }
            Phase::InitiateBlock => {
                Next::Message(Request::InitiateBlockDownload { address, crc: true, size: Some(self.size) })
            }
            Phase::Block => {
                let (segment, last) = self.segment(self.sent.saturating_add(1))?;
                self.sent = segment.number;
                if last || self.sent >= self.block {
                    self.phase = Phase::Acknowledgement;
                }
                Next::Segment(segment)
            }
            Phase::Acknowledgement | Phase::Probe { .. } => Next::Segment(self.segment(self.sent)?.0),
            Phase::ProbeEnd { .. } | Phase::End { .. } => Next::Message(self.end()),
        })
    }

    fn segment(&mut self, number: u8) -> Result<(BlockSegment, bool), Next> {
        let (offset, _) = self.wanted();
        let bytes = self.take_supplied()?;
        let last = offset.saturating_add(bytes.len() as u32) >= self.size;
        Ok((BlockSegment { number, last, data: padded(&bytes).0 }, last))
    }

    fn end(&self) -> Request {
        let unused = match self.size % SEGMENT as u32 {
            0 if self.size > 0 => 0,
            used => SEGMENT as u8 - used as u8,
        };
        Request::EndBlockDownload { unused, crc: if self.checks { self.crc.0 } else { 0 } }
    }

    /// Whether the last segment of all is among those sent.
    fn all_sent(&self) -> bool {
        self.position(self.sent) >= self.size
    }

    /// Where the data stand after so many segments of the block.
    fn position(&self, segments: u8) -> u32 {
        let bytes = u32::from(segments) * SEGMENT as u32;
        self.confirmed.saturating_add(bytes).min(self.size)
    }

    /// After a time-out: whether it may be tried again.
    pub fn again(&mut self) -> bool {
        self.phase = match self.phase {
            // Nothing is written twice.
            Phase::Initiate | Phase::Segment { .. } | Phase::InitiateBlock | Phase::Block => return false,
            // A server that has acknowledged the last segment of all would not understand it again, but understands the end; one
            // that has not takes the end for a segment out of order, unless its number is by chance the right one.
            Phase::Acknowledgement if self.all_sent() => {
                let [first, ..] = self.end().to_bytes();
                if self.sent >= first & !0x80 {
                    return false;
                }
                Phase::ProbeEnd { again: false }
            }
            // In the next block it would be the right one.
            Phase::Acknowledgement if self.sent < 2 => return false,
            Phase::Acknowledgement => Phase::Probe { again: false },
            // The answer may be lost, too.
            Phase::Probe { again: false } => Phase::Probe { again: true },
            Phase::ProbeEnd { again: false } => Phase::ProbeEnd { again: true },
            // CANopenNode passes over all of a block whose first segment it lacks.
            Phase::Probe { .. } | Phase::ProbeEnd { .. } if self.checks => {
                self.unsure = true;
                self.sent = 0;
                Phase::Block
            }
            Phase::Probe { .. } | Phase::ProbeEnd { .. } => return false,
            Phase::End { .. } => Phase::End { repeated: true },
        };
        self.supplied = None;
        true
    }

    /// `sending`: no response is due.
    pub fn receive(&mut self, address: Address, data: &[u8], sending: bool, counters: &mut Counters) -> Step {
        match (self.phase, Response::parse(data)) {
            (Phase::Block, Ok(Response::AcknowledgeBlock { last, block })) => {
                match self.acknowledge(last, block, counters) {
                    Step::Send => Step::Settle { progress: true },
                    Step::Again => Step::Settle { progress: false },
                    other => other,
                }
            }
            _ if sending => Step::Foreign,
            (Phase::Initiate, Ok(Response::InitiateDownload { address: of })) if of == address => {
                if matches!(self.size, 1..=4) {
                    return Step::End(Ok(Outcome::Written));
                }
                self.phase = Phase::Segment { toggle: false };
                Step::Send
            }
            (Phase::Segment { toggle: sent }, Ok(Response::DownloadSegment { toggle })) => {
                if toggle != sent {
                    return Step::End(Err(Failure::Toggle));
                }
                self.confirmed = self.position(1);
                if self.confirmed >= self.size {
                    return Step::End(Ok(Outcome::Written));
                }
                self.phase = Phase::Segment { toggle: !toggle };
                Step::Send
            }
            (Phase::InitiateBlock, Ok(Response::InitiateBlockDownload { address: of, crc, block }))
                if of == address =>
            {
                self.checks = crc;
                self.take_block(block, Step::Send)
            }
            // It lacks the first segment, too; or it has acknowledged the block, and how much of it is lost.
            (
                Phase::Probe { .. } | Phase::ProbeEnd { .. },
                Ok(Response::AcknowledgeBlock { last: 0, block }),
            ) => {
                self.unsure = true;
                if self.checks {
                    self.acknowledge(0, block, counters)
                } else {
                    Step::End(Err(Failure::Position))
                }
            }
            (
                Phase::Acknowledgement | Phase::Probe { .. } | Phase::ProbeEnd { .. },
                Ok(Response::AcknowledgeBlock { last, block }),
            ) => self.acknowledge(last, block, counters),
            (Phase::ProbeEnd { .. } | Phase::End { .. }, Ok(Response::EndBlockDownload)) => {
                Step::End(Ok(Outcome::Written))
            }
            _ => Step::Foreign,
        }
    }

    fn acknowledge(&mut self, last: u8, block: u8, counters: &mut Counters) -> Step {
        if last > self.sent {
            return Step::End(Err(Failure::Sequence { sent: self.sent, received: last }));
        }
        let all = last == self.sent && self.all_sent();
        counters.repeated = counters.repeated.wrapping_add(u32::from(self.sent - last));
        self.confirmed = self.position(last);
        self.supplied = None;
        if all {
            self.phase = Phase::End { repeated: false };
            return Step::Send;
        }
        self.take_block(block, if last == 0 { Step::Again } else { Step::Send })
    }

    /// Begins a block.
    fn take_block(&mut self, block: u8, step: Step) -> Step {
        if !(1..=MAX_BLOCK).contains(&block) {
            return Step::End(Err(Failure::BlockSize { received: block }));
        }
        self.block = block;
        self.sent = 0;
        self.phase = Phase::Block;
        step
    }
}
