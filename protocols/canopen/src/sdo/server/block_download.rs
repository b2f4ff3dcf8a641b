//! An object is written in blocks (7.2.4.3.9 to 7.2.4.3.11).

use super::plain::judge_size;
use super::{Dictionary, Message, Step};
use crate::sdo::{Abort, BlockSegment, Request, Response, SEGMENT, crc};

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct BlockDownload {
    size: Option<u32>,
    /// The client gives a CRC.
    checks: bool,
    crc: u16,
    received: u32,
    /// Segments that this block has at most.
    block: u8,
    /// Segments of it that came in order.
    came: u8,
    /// The last segment that came in order: how many of its bytes count is not known yet.
    held: Option<BlockSegment>,
    /// What the last acknowledgement said, and the segment that it answered, while nothing of the next block has come.
    acknowledged: Option<(u8, BlockSegment)>,
    /// All segments have come.
    whole: bool,
}

impl BlockDownload {
    pub const fn new(size: Option<u32>, block: u8, checks: bool) -> Self {
        Self {
            size,
            checks,
            crc: 0,
            received: 0,
            block,
            came: 0,
            held: None,
            acknowledged: None,
            whole: false,
        }
    }

    /// `block`: segments of the next block.
    pub fn receive<D: Dictionary>(&mut self, message: Message, block: u8, dictionary: &mut D) -> Step {
        if self.whole {
            return self.end(message, dictionary);
        }
        let Ok(segment) = BlockSegment::parse(&message) else {
            return Abort::COMMAND.into();
        };
        let acknowledged = self.acknowledged.take();
        if segment.number == self.came + 1 {
            if let Err(code) = self.settle(SEGMENT, dictionary) {
                return code.into();
            }
            (self.held, self.came) = (Some(segment), segment.number);
            self.whole = segment.last;
        } else if let Some((last, answered)) = acknowledged
            && answered == segment
        {
            // The acknowledgement was lost: the client repeats its last segment.
            return self.acknowledge(last, segment);
        }
        if self.whole || segment.number >= self.block || segment.last {
            self.block = block;
            let last = core::mem::take(&mut self.came);
            return self.acknowledge(last, segment);
        }
        Step::Go(None)
    }

    fn acknowledge(&mut self, last: u8, answered: BlockSegment) -> Step {
        self.acknowledged = Some((last, answered));
        Step::Go(Some(Response::AcknowledgeBlock { last, block: self.block }.to_bytes()))
    }

    /// Of the last segment that came so many bytes count.
    fn settle<D: Dictionary>(&mut self, count: usize, dictionary: &mut D) -> Result<(), Abort> {
        let Some(segment) = self.held.take() else {
            return Ok(());
        };
        let bytes = segment.data.get(..count).unwrap_or_default();
        self.crc = crc(self.crc, bytes);
        self.received = self.received.saturating_add(bytes.len() as u32);
        judge_size(self.size, self.received, false)?;
        dictionary.write(bytes)
    }

    /// All segments have come: this is the end, or the last segment once more.
    fn end<D: Dictionary>(&mut self, message: Message, dictionary: &mut D) -> Step {
        let end = match Request::parse(&message) {
            Ok(Request::EndBlockDownload { unused, crc }) => Some((SEGMENT - usize::from(unused), crc)),
            _ => None,
        };
        let repeated = self.acknowledged.filter(|(_, answered)| answered.to_bytes() == message);
        match end {
            // A segment may look like an end; its CRC does not hold then.
            Some((count, crc)) if repeated.is_none() || (self.checks && self.total(count) == crc) => {
                match self.finish(count, crc, dictionary) {
                    Ok(()) => Step::End(Some(Response::EndBlockDownload.to_bytes())),
                    Err(code) => code.into(),
                }
            }
            _ => match repeated {
                Some((last, segment)) => self.acknowledge(last, segment),
                None => Abort::COMMAND.into(),
            },
        }
    }

    /// The CRC over all, if of the last segment so many bytes count.
    fn total(&self, count: usize) -> u16 {
        let last = self.held.as_ref().and_then(|held| held.data.get(..count));
        crc(self.crc, last.unwrap_or_default())
    }

    fn finish<D: Dictionary>(&mut self, count: usize, crc: u16, dictionary: &mut D) -> Result<(), Abort> {
        self.settle(count, dictionary)?;
        if self.checks && self.crc != crc {
            return Err(Abort::CRC);
        }
        judge_size(self.size, self.received, true)?;
        dictionary.finish()
    }
}
