//! Finds frames in the bytes of a line.

use core::ops::Range;

use crate::frame::{self, Frame, HEADER, Kind, PREAMBLE};

/// Finds frames in the bytes of a line, whatever is between them.
///
/// A frame is searched from every 7E on: nothing keeps 7E and 0A from being data. One that is incomplete holds back what
/// begins inside it, for that may be its data, until it is complete or the line falls silent. One that turns out damaged
/// is searched for others that begin inside it. It makes no difference in which portions the bytes come.
///
/// `N` is the longest frame that can be taken, at most [`frame::MAX_FRAME`]. Longer ones are passed over whole.
#[derive(Clone, Debug)]
pub struct Decoder<const N: usize> {
    /// Empty, or what may be a frame from its 7E on.
    bytes: heapless::Vec<u8, N>,
    /// With so many bytes there is something to judge.
    needed: usize,
    /// So many bytes of a frame that is too long are still to come.
    passing: usize,
    /// Nothing will follow what is there.
    silent: bool,
    found: Option<Found>,
    damaged: u32,
    garbage: u32,
}

/// The frame at the front of the bytes.
#[derive(Clone, Debug)]
struct Found {
    origin: u8,
    kind: Kind,
    body: Range<usize>,
    length: usize,
}

impl<const N: usize> Decoder<N> {
    /// A decoder that waits for 7E.
    pub const fn new() -> Self {
        Self {
            bytes: heapless::Vec::new(),
            needed: HEADER,
            passing: 0,
            silent: false,
            found: None,
            damaged: 0,
            garbage: 0,
        }
    }

    /// Takes a byte. [`Decoder::advance`] before the next, while [`Decoder::is_ready`]; frames are lost otherwise.
    pub fn push(&mut self, byte: u8) {
        self.forget();
        self.silent = false;
        if self.passing > 0 {
            self.passing -= 1;
        } else if self.bytes.is_empty() && byte != PREAMBLE {
            self.garbage = self.garbage.wrapping_add(1);
        } else if self.bytes.push(byte).is_err() {
            // Nobody has asked for frames.
            self.drop_front(1);
            let _ = self.bytes.push(byte);
        }
    }

    /// The line has been silent: what is incomplete will remain so.
    pub fn silence(&mut self) {
        self.forget();
        self.passing = 0;
        self.silent = true;
    }

    /// Whether [`Decoder::advance`] has something to do.
    pub fn is_ready(&self) -> bool {
        self.found.is_some() || self.bytes.len() >= self.needed || (self.silent && !self.bytes.is_empty())
    }

    /// Whether something is there that may become a frame, or is passed over.
    pub fn is_inside(&self) -> bool {
        !self.bytes.is_empty() || self.passing > 0
    }

    /// Goes on to the next frame; false if there is none.
    pub fn advance(&mut self) -> bool {
        self.forget();
        while !self.bytes.is_empty() && (self.silent || self.bytes.len() >= self.needed) {
            if self.judge() {
                return true;
            }
        }
        false
    }

    /// The frame that [`Decoder::advance`] has found.
    pub fn frame(&self) -> Option<Frame<'_>> {
        let Found { origin, kind, body, .. } = self.found.as_ref()?;
        Some(Frame { origin: *origin, kind: *kind, body: self.bytes.get(body.clone())? })
    }

    /// That frame's bytes.
    pub fn frame_bytes(&self) -> &[u8] {
        let length = self.found.as_ref().map_or(0, |found| found.length);
        self.bytes.get(..length).unwrap_or_default()
    }

    /// Frames whose check did not hold, modulo 2^32. Garbage may look like one.
    pub const fn damaged(&self) -> u32 {
        self.damaged
    }

    /// Bytes that belonged to no frame, modulo 2^32.
    pub const fn garbage(&self) -> u32 {
        self.garbage
    }

    /// Judges what begins with the first byte, and drops it if that is no frame; true if it is one.
    fn judge(&mut self) -> bool {
        let length = self.bytes.first_chunk().map(|header| frame::announced(*header));
        match length {
            Some(Ok(length)) if length > N && !self.silent => {
                self.passing = length - self.bytes.len();
                self.bytes.clear();
                self.needed = HEADER;
            }
            Some(Ok(length)) if self.bytes.len() >= length => return self.check(length),
            Some(Ok(length)) if !self.silent => self.needed = length,
            None if !self.silent => self.needed = HEADER,
            _ => self.drop_front(1),
        }
        false
    }

    fn check(&mut self, length: usize) -> bool {
        match frame::parse(self.bytes.get(..length).unwrap_or_default()) {
            Ok(Frame { origin, kind, body }) => {
                let body = HEADER..HEADER + body.len();
                self.found = Some(Found { origin, kind, body, length });
                true
            }
            Err(_) => {
                self.damaged = self.damaged.wrapping_add(1);
                self.drop_front(1);
                false
            }
        }
    }

    /// Drops the frame that has been found.
    fn forget(&mut self) {
        if let Some(found) = self.found.take() {
            self.garbage = self.garbage.wrapping_sub(found.length as u32);
            self.drop_front(found.length);
        }
    }

    /// Drops `count` bytes, and what follows them up to the next 7E.
    fn drop_front(&mut self, count: usize) {
        let rest = self.bytes.get(count..).unwrap_or_default();
        let count = rest.iter().position(|byte| *byte == PREAMBLE).map_or(self.bytes.len(), |at| count + at);
        self.bytes.rotate_left(count);
        self.bytes.truncate(self.bytes.len() - count);
        self.needed = HEADER;
        self.garbage = self.garbage.wrapping_add(count as u32);
    }
}

impl<const N: usize> Default for Decoder<N> {
    fn default() -> Self {
        Self::new()
    }
}
