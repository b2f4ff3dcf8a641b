//! Finds RTU frames in the bytes of a line.
//!
//! The specification ends a frame by 3.5 characters of silence and voids one with a pause of more than 1.5 characters in it.
//! Behind an operating system or a USB adapter bytes come in bursts, so that pauses appear where the line had none and
//! vanish where it had some. Therefore:
//!
//! - A frame ends where its function code says, as soon as its CRC holds there. No pause inside it voids it.
//! - Silence ends a frame whose function code does not tell its length.
//! - A frame is searched from every byte on. While bytes keep coming, one that is still incomplete holds back what begins
//!   inside it: its data may look like a frame. After a silence it no longer does, but it may still be completed.
//!
//! Bytes are judged one by one, so that it makes no difference in which portions they come.

use crate::length::Length;
use crate::rtu::{self, MAX_ADU, MIN_ADU, OVERHEAD};
use crate::{Frame, FrameError, Pdu};

/// Bytes that may become frames.
#[derive(Clone, Debug)]
pub(crate) struct Stream {
    bytes: heapless::Vec<u8, MAX_ADU>,
    /// So many bytes came before the last silence,
    settled: usize,
    /// and so many of them before the silence before it.
    reported: usize,
    /// What was wrong with the first frame of this burst.
    damage: Option<FrameError>,
    garbage: u32,
}

enum Verdict {
    Frame(usize),
    Wait,
    No,
}

impl Stream {
    pub const fn new() -> Self {
        Self { bytes: heapless::Vec::new(), settled: 0, reported: 0, damage: None, garbage: 0 }
    }

    /// Takes a byte; the oldest makes room for it.
    pub fn push(&mut self, byte: u8) {
        if self.bytes.is_full() {
            self.damage.get_or_insert(FrameError::TooLong);
            self.discard(1);
        }
        let _ = self.bytes.push(byte);
    }

    /// The line has been silent. [`Stream::next`] gives frames that ended thereby, then [`Stream::damage`] tells about the rest.
    pub fn silence(&mut self) {
        self.reported = self.settled;
        self.settled = self.bytes.len();
    }

    /// Whether a silence would tell anything new.
    pub fn is_unsettled(&self) -> bool {
        self.bytes.len() > self.settled || self.damage.is_some()
    }

    /// What was wrong with the burst before the last silence.
    pub fn damage(&mut self) -> Option<FrameError> {
        self.damage.take()
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.discard(self.bytes.len());
        self.damage = None;
    }

    /// Bytes that belonged to no frame.
    pub fn garbage(&self) -> u32 {
        self.garbage
    }

    /// The next frame. `lengths` gives the PDU lengths that are possible for a frame which begins with these bytes.
    pub fn next(&mut self, lengths: impl Fn(&[u8]) -> [Length; 2]) -> Option<Frame> {
        let mut held = false;
        let mut at = 0;
        while at < self.bytes.len() {
            match self.judge(at, &lengths) {
                Verdict::Frame(length) => return self.take(at, length),
                Verdict::Wait if at >= self.settled => return None,
                Verdict::Wait => held = true,
                Verdict::No if !held => {
                    self.discard(1);
                    continue;
                }
                Verdict::No => {}
            }
            at += 1;
        }
        None
    }

    fn judge(&mut self, at: usize, lengths: impl Fn(&[u8]) -> [Length; 2]) -> Verdict {
        let silent = self.settled == self.bytes.len();
        let adu = self.bytes.get(at..).unwrap_or(&[]);
        let mut verdict = Verdict::No;
        let mut damage = None;
        for length in lengths(adu) {
            let end = match length {
                Length::Known(pdu) => pdu + OVERHEAD,
                Length::Silence if silent => adu.len().max(MIN_ADU),
                Length::Silence | Length::More => MAX_ADU + 1,
                Length::Never => continue,
            };
            match adu.get(..end).map(rtu::parse) {
                Some(Ok(_)) => return Verdict::Frame(end),
                Some(Err(error)) => damage = damage.or(Some(error)),
                None => verdict = Verdict::Wait,
            }
            if matches!(length, Length::Silence) {
                verdict = Verdict::Wait;
            }
        }
        // A frame that silence cut is reported once, at that silence.
        if silent && at >= self.reported && matches!(verdict, Verdict::Wait) {
            damage = damage.or(Some(FrameError::TooShort));
        }
        if let (None, Some(error)) = (self.damage, damage) {
            self.damage = Some(error);
        }
        verdict
    }

    fn take(&mut self, at: usize, length: usize) -> Option<Frame> {
        let adu = self.bytes.get(at..at + length)?;
        let frame = match rtu::parse(adu) {
            Ok((unit, pdu)) => Pdu::from_slice(pdu).ok().map(|pdu| Frame { unit, pdu }),
            Err(_) => None,
        };
        self.discard(at + length);
        self.garbage = self.garbage.wrapping_sub(length as u32);
        self.damage = None;
        frame
    }

    /// Drops `count` bytes from the front.
    fn discard(&mut self, count: usize) {
        let count = count.min(self.bytes.len());
        self.bytes.rotate_left(count);
        self.bytes.truncate(self.bytes.len() - count);
        self.settled = self.settled.saturating_sub(count);
        self.reported = self.reported.saturating_sub(count);
        self.garbage = self.garbage.wrapping_add(count as u32);
    }
}
