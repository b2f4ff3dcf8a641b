//! An object is read in blocks (7.2.4.3.13 to 7.2.4.3.15).

use super::{Dictionary, Message, Step};
use crate::sdo::{Abort, BlockSegment, MAX_BLOCK, Request, Response, SEGMENT, crc};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// It waits to be started.
    Start,
    /// Segments of a block go out.
    Sending,
    /// A block is out.
    Acknowledgement,
    /// The end has been said.
    End,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BlockUpload {
    size: u32,
    phase: Phase,
    /// Bytes that are acknowledged; may be more than there are, by what is unused in the last segment.
    acknowledged: u32,
    /// Segments that the block has at most.
    block: u8,
    /// Segments of it that are out.
    sent: u8,
    /// The client checks a CRC.
    checks: bool,
    /// Over what is acknowledged.
    crc: u16,
}

impl BlockUpload {
    pub const fn new(size: u32, block: u8, checks: bool) -> Self {
        Self { size, phase: Phase::Start, acknowledged: 0, block, sent: 0, checks, crc: 0 }
    }

    pub fn is_sending(&self) -> bool {
        self.phase == Phase::Sending
    }

    /// Where a segment of this block begins.
    fn offset(&self, segments: u8) -> u32 {
        self.acknowledged.saturating_add(u32::from(segments) * SEGMENT as u32)
    }

    /// The next segment.
    pub fn next<D: Dictionary>(&mut self, dictionary: &mut D) -> Option<Message> {
        let offset = self.offset(self.sent);
        let rest = self.size.saturating_sub(offset);
        let data = self.bytes(offset, dictionary);
        self.sent += 1;
        let last = rest <= SEGMENT as u32;
        if last || self.sent == self.block {
            self.phase = Phase::Acknowledgement;
        }
        Some(BlockSegment { number: self.sent, last, data }.to_bytes())
    }

    /// Seven bytes, zeros where there are no more.
    fn bytes<D: Dictionary>(&self, offset: u32, dictionary: &mut D) -> [u8; SEGMENT] {
        let mut data = [0; SEGMENT];
        let rest = self.size.saturating_sub(offset).min(SEGMENT as u32);
        dictionary.read(offset, data.get_mut(..rest as usize).unwrap_or_default());
        data
    }

    pub fn receive<D: Dictionary>(&mut self, request: &Request, dictionary: &mut D) -> Step {
        match (request, self.phase) {
            (Request::StartBlockUpload, Phase::Start) => {
                self.phase = Phase::Sending;
                Step::Go(None)
            }
            (Request::AcknowledgeBlock { last, block }, Phase::Sending | Phase::Acknowledgement) => {
                self.acknowledge(*last, *block, dictionary)
            }
            // The end was lost.
            (Request::AcknowledgeBlock { .. }, Phase::End) => Step::Go(Some(self.end())),
            (Request::EndBlockUpload, Phase::End) => Step::End(None),
            _ => Abort::COMMAND.into(),
        }
    }

    /// The client has so many segments of the block; what is missing comes again.
    fn acknowledge<D: Dictionary>(&mut self, last: u8, block: u8, dictionary: &mut D) -> Step {
        if last > self.sent {
            return Abort::SEQUENCE.into();
        }
        if !(1..=MAX_BLOCK).contains(&block) {
            return Abort::BLOCK_SIZE.into();
        }
        for segment in 0..last {
            let offset = self.offset(segment);
            let data = self.bytes(offset, dictionary);
            let count = self.size.saturating_sub(offset).min(SEGMENT as u32) as usize;
            self.crc = crc(self.crc, data.get(..count).unwrap_or_default());
        }
        self.acknowledged = self.offset(last);
        (self.block, self.sent) = (block, 0);
        if last > 0 && self.acknowledged >= self.size {
            self.phase = Phase::End;
            return Step::Go(Some(self.end()));
        }
        self.phase = Phase::Sending;
        Step::Go(None)
    }

    fn end(&self) -> Message {
        let unused = self.acknowledged.saturating_sub(self.size) as u8;
        Response::EndBlockUpload { unused, crc: if self.checks { self.crc } else { 0 } }.to_bytes()
    }
}
