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
use crate::rtu::{self, MAX_ADU, OVERHEAD};
use crate::{Frame, FrameError, Pdu};

/// Bytes that may become frames.
#[derive(Clone, Debug)]
pub(crate) struct Stream {
    bytes: heapless::Vec<u8, MAX_ADU>,
    /// So many bytes came before the last silence.
    settled: usize,
    /// So many bytes belong to bursts that [`Stream::damage`] has told about.
    reported: usize,
    /// What is wrong with the first frame of this burst.
    damage: Option<FrameError>,
    /// This burst has bytes that cannot even begin a frame.
    noise: bool,
    /// With fewer bytes there is nothing new to judge before a silence.
    look_at: usize,
    garbage: u32,
}

enum Verdict {
    Frame(usize),
    /// Until there are so many bytes, or silence.
    Wait(usize),
    No,
}

impl Verdict {
    /// Waits for `length` bytes too.
    fn or_wait(self, length: usize) -> Self {
        match self {
            Verdict::Wait(other) => Verdict::Wait(other.min(length)),
            _ => Verdict::Wait(length),
        }
    }
}

impl Stream {
    pub const fn new() -> Self {
        Self {
            bytes: heapless::Vec::new(),
            settled: 0,
            reported: 0,
            damage: None,
            noise: false,
            look_at: 0,
            garbage: 0,
        }
    }

    /// Takes a byte; the oldest makes room for it.
    pub fn push(&mut self, byte: u8) {
        if self.bytes.is_full() {
            self.noise = true;
            self.discard(1);
        }
        let _ = self.bytes.push(byte);
    }

    /// The line has been silent. [`Stream::next`] gives frames that ended thereby, then [`Stream::damage`] tells about the rest.
    pub fn silence(&mut self) {
        self.settled = self.bytes.len();
        self.look_at = 0;
    }

    /// Whether a silence would tell anything new.
    pub fn is_unsettled(&self) -> bool {
        self.bytes.len() > self.settled || self.damage.is_some() || self.noise
    }

    /// What was wrong with the burst before the last silence.
    pub fn damage(&mut self) -> Option<FrameError> {
        let noise = core::mem::take(&mut self.noise).then_some(FrameError::TooShort);
        self.reported = self.settled;
        self.damage.take().or(noise)
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.discard(self.bytes.len());
        self.damage = None;
        self.noise = false;
    }

    /// Bytes that belonged to no frame.
    pub fn garbage(&self) -> u32 {
        self.garbage
    }

    /// The next frame. `lengths` gives the PDU lengths that are possible for a frame which begins with these bytes.
    pub fn next(&mut self, lengths: impl Fn(&[u8]) -> [Length; 2]) -> Option<Frame> {
        if self.bytes.len() < self.look_at {
            return None;
        }
        let mut held = false;
        let mut at = 0;
        while at < self.bytes.len() {
            match self.judge(at, &lengths) {
                Verdict::Frame(length) => return self.take(at, length),
                Verdict::Wait(length) if at >= self.settled => {
                    self.look_at = at.saturating_add(length).min(MAX_ADU);
                    return None;
                }
                Verdict::Wait(_) => held = true,
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

    /// Whether a frame begins at `at`.
    fn judge(&mut self, at: usize, lengths: impl Fn(&[u8]) -> [Length; 2]) -> Verdict {
        let silent = self.settled == self.bytes.len();
        let adu = self.bytes.get(at..).unwrap_or(&[]);
        let mut verdict = Verdict::No;
        let mut damage = None;
        for length in lengths(adu) {
            let end = match length {
                Length::Known(pdu) => pdu + OVERHEAD,
                Length::Silence if silent => adu.len(),
                Length::Silence | Length::More => usize::MAX,
                Length::Never => continue,
            };
            match adu.get(..end).map(rtu::parse) {
                Some(Ok(_)) => return Verdict::Frame(end),
                // Silence may have been only in the way of the bytes to us: more may come.
                Some(Err(error)) if matches!(length, Length::Silence) => {
                    damage = damage.or(Some(error));
                    verdict = verdict.or_wait(adu.len() + 1);
                }
                Some(Err(error)) => damage = damage.or(Some(error)),
                None => {
                    damage = damage.or(silent.then_some(FrameError::TooShort));
                    verdict = verdict.or_wait(if length == Length::More { adu.len() + 1 } else { end });
                }
            }
        }
        if at >= self.reported {
            self.damage = self.damage.or(damage);
            self.noise |= matches!(verdict, Verdict::No);
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
        self.noise = false;
        frame
    }

    /// Drops `count` bytes from the front.
    fn discard(&mut self, count: usize) {
        let count = count.min(self.bytes.len());
        self.look_at = 0;
        self.bytes.rotate_left(count);
        self.bytes.truncate(self.bytes.len() - count);
        self.settled = self.settled.saturating_sub(count);
        self.reported = self.reported.saturating_sub(count);
        self.garbage = self.garbage.wrapping_add(count as u32);
    }
}
