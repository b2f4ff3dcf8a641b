//! Reading.

use heapless::Vec;

use super::super::{BlockSegment, Initiate, Request, Response, SEGMENT, crc};
use super::work::{Next, Step};
use super::{Config, Counters, Failure, MAX_BLOCK, Outcome, count};
use crate::Address;

/// What is sent next, or what was sent last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Initiate,
    /// Asks for a plain segment.
    Segment {
        toggle: bool,
    },
    InitiateBlock,
    /// Lets the first block come.
    Start,
    /// Acknowledges the segments up to this one; all of them have come where it is `last`.
    Acknowledge {
        number: u8,
        last: bool,
    },
    /// The end of a block transfer.
    End,
}

/// An upload, plain or in blocks.
#[derive(Clone, Debug)]
pub(super) struct Upload {
    phase: Phase,
    size: Option<u32>,
    received: u32,
    /// Segments of the block that has been asked for.
    block: u8,
    /// The next segment's number in the block.
    number: u8,
    /// Some segment of the block has come.
    heard: bool,
    /// The last segment of a block transfer: how much of it counts is not yet known.
    held: Option<[u8; SEGMENT]>,
    /// The server gives a CRC.
    checks: bool,
    crc: u16,
    /// Nothing more follows.
    over: bool,
}

impl Upload {
    pub const fn new(block: bool) -> Self {
        Self {
            phase: if block { Phase::InitiateBlock } else { Phase::Initiate },
            size: None,
            received: 0,
            block: 0,
            number: 1,
            heard: false,
            held: None,
            checks: false,
            crc: 0,
            over: false,
        }
    }

    pub const fn is_block(&self) -> bool {
        !matches!(self.phase, Phase::Initiate | Phase::Segment { .. })
    }

    pub const fn is_over(&self) -> bool {
        self.over
    }

    /// Whether what comes next is a segment of a block.
    pub const fn hears_segments(&self) -> bool {
        matches!(self.phase, Phase::Start | Phase::Acknowledge { last: false, .. })
    }

    /// Whether what is sent next brings data, other than the few that a response may have.
    pub const fn brings_data(&self) -> bool {
        matches!(self.phase, Phase::Segment { .. } | Phase::Start | Phase::Acknowledge { .. })
    }

    pub fn outcome(&self) -> Result<Outcome, Failure> {
        Ok(Outcome::Read { size: self.received, checked: self.size.is_some() || self.checks })
    }

    pub fn next(&mut self, config: &Config, address: Address) -> Next {
        let block = config.block.clamp(1, MAX_BLOCK);
        Next::Message(match self.phase {
            Phase::Initiate => Request::InitiateUpload { address },
            Phase::Segment { toggle } => Request::UploadSegment { toggle },
            Phase::InitiateBlock => {
                self.block = block;
                let threshold = config.threshold;
                Request::InitiateBlockUpload { address, crc: true, block, threshold }
            }
            Phase::Start => Request::StartBlockUpload,
            Phase::Acknowledge { number, .. } => {
                self.number = 1;
                self.heard = false;
                self.block = block;
                Request::AcknowledgeBlock { last: number, block }
            }
            Phase::End => {
                self.over = true;
                Request::EndBlockUpload
            }
        })
    }

    /// After a time-out: whether it may be tried again.
    pub fn again(&mut self) -> bool {
        match self.phase {
            Phase::Initiate | Phase::InitiateBlock => true,
            // The toggle bit would not alternate.
            Phase::Segment { .. } | Phase::End => false,
            // Nothing came: the message was lost; or all of a block, which CRC or size will tell.
            Phase::Start | Phase::Acknowledge { .. } if !self.heard => self.checks || self.size.is_some(),
            Phase::Start | Phase::Acknowledge { .. } => {
                self.phase = Phase::Acknowledge { number: self.number - 1, last: false };
                true
            }
        }
    }

    pub fn receive(
        &mut self,
        config: &Config,
        address: Address,
        data: &[u8],
        portion: &mut Vec<u8, SEGMENT>,
        counters: &mut Counters,
    ) -> Step {
        if self.hears_segments() {
            return match BlockSegment::parse(data) {
                Ok(segment) => self.take_segment(segment, portion, counters),
                Err(_) => Step::Foreign,
            };
        }
        match (self.phase, Response::parse(data)) {
            (Phase::Initiate, Ok(Response::InitiateUpload { address: of, data })) if of == address => {
                self.begin(data, portion)
            }
            // The server prefers the plain protocol, where it may.
            (Phase::InitiateBlock, Ok(Response::InitiateUpload { address: of, data }))
                if of == address && config.threshold > 0 =>
            {
                self.phase = Phase::Initiate;
                self.begin(data, portion)
            }
            (Phase::Segment { toggle }, Ok(Response::UploadSegment(segment))) => {
                if segment.toggle != toggle {
                    return Step::End(Err(Failure::Toggle));
                }
                self.phase = Phase::Segment { toggle: !toggle };
                self.received = self.received.saturating_add(segment.data.len() as u32);
                *portion = segment.data;
                match self.fits(segment.last) {
                    Err(failure) => Step::End(Err(failure)),
                    Ok(()) if segment.last => Step::End(self.outcome()),
                    Ok(()) => Step::Send,
                }
            }
            (Phase::InitiateBlock, Ok(Response::InitiateBlockUpload { address: of, crc, size }))
                if of == address =>
            {
                self.checks = crc;
                self.size = size;
                self.phase = Phase::Start;
                Step::Send
            }
            (Phase::Acknowledge { last: true, .. }, Ok(Response::EndBlockUpload { unused, crc })) => {
                self.end(unused, crc, portion)
            }
            _ => Step::Foreign,
        }
    }

    fn begin(&mut self, data: Initiate, portion: &mut Vec<u8, SEGMENT>) -> Step {
        let bytes: &[u8] = match &data {
            Initiate::Expedited(bytes) => bytes,
            Initiate::Unsized(bytes) => bytes,
            Initiate::Segmented { size } => {
                self.size = *size;
                self.phase = Phase::Segment { toggle: false };
                return Step::Send;
            }
        };
        self.received = bytes.len() as u32;
        if matches!(data, Initiate::Expedited(_)) {
            self.size = Some(self.received);
        }
        put(portion, bytes);
        Step::End(self.outcome())
    }

    /// Whether as many bytes came as were to come, at the end, or no more than that before it.
    fn fits(&self, last: bool) -> Result<(), Failure> {
        match self.size {
            Some(expected) if self.received > expected || (last && self.received < expected) => {
                Err(Failure::Size { expected, received: self.received })
            }
            _ => Ok(()),
        }
    }

    fn take_segment(
        &mut self,
        segment: BlockSegment,
        portion: &mut Vec<u8, SEGMENT>,
        counters: &mut Counters,
    ) -> Step {
        self.heard = true;
        let ends = segment.last || segment.number >= self.block;
        // One that comes before its predecessor has been given to the caller has no place.
        if segment.number != self.number || !portion.is_empty() {
            count(&mut counters.repeated);
            if !ends {
                return Step::Skip;
            }
            // What is lacking comes again.
            self.phase = Phase::Acknowledge { number: self.number - 1, last: false };
            return if self.number > 1 { Step::Send } else { Step::Again };
        }
        if let Some(held) = self.held.replace(segment.data) {
            self.keep(&held, portion);
        }
        if ends {
            self.phase = Phase::Acknowledge { number: segment.number, last: segment.last };
            return match self.fits(false) {
                Ok(()) => Step::Send,
                Err(failure) => Step::End(Err(failure)),
            };
        }
        self.number += 1;
        Step::Wait
    }

    fn keep(&mut self, bytes: &[u8], portion: &mut Vec<u8, SEGMENT>) {
        self.received = self.received.saturating_add(bytes.len() as u32);
        self.crc = crc(self.crc, bytes);
        put(portion, bytes);
    }

    fn end(&mut self, unused: u8, received: u16, portion: &mut Vec<u8, SEGMENT>) -> Step {
        if let Some(held) = self.held.take() {
            let length = SEGMENT - usize::from(unused).min(SEGMENT);
            self.keep(held.get(..length).unwrap_or_default(), portion);
        }
        if self.checks && received != self.crc {
            return Step::End(Err(Failure::Crc { expected: self.crc, received }));
        }
        if let Err(failure) = self.fits(true) {
            return Step::End(Err(failure));
        }
        self.phase = Phase::End;
        Step::Send
    }
}

/// The bytes of one message fit: they are given before the next one is asked for.
fn put(portion: &mut Vec<u8, SEGMENT>, bytes: &[u8]) {
    portion.clear();
    let _ = portion.extend_from_slice(bytes);
}
