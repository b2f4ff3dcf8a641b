//! Transfers whose segments are confirmed one by one.

use heapless::Vec;

use super::{Dictionary, Step};
use crate::sdo::{Abort, Response, SEGMENT, Segment};

/// An object is read (7.2.4.3.7).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Upload {
    size: u32,
    offset: u32,
    /// That of the next segment.
    toggle: bool,
}

impl Upload {
    pub const fn new(size: u32) -> Self {
        Self { size, offset: 0, toggle: false }
    }

    pub fn next<D: Dictionary>(&mut self, toggle: bool, dictionary: &mut D) -> Step {
        if toggle != self.toggle {
            return Abort::TOGGLE.into();
        }
        let rest = self.size - self.offset;
        let mut data = Vec::from_array([0; SEGMENT]);
        data.truncate(rest as usize);
        dictionary.read(self.offset, &mut data);
        let last = rest <= SEGMENT as u32;
        let answer = Some(Response::UploadSegment(Segment { toggle, last, data }).to_bytes());
        if last {
            return Step::End(answer);
        }
        self.offset += SEGMENT as u32;
        self.toggle = !toggle;
        Step::Go(answer)
    }
}

/// An object is written (7.2.4.3.4).
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Download {
    size: Option<u32>,
    received: u32,
    toggle: bool,
}

impl Download {
    pub const fn new(size: Option<u32>) -> Self {
        Self { size, received: 0, toggle: false }
    }

    pub fn receive<D: Dictionary>(&mut self, segment: &Segment, dictionary: &mut D) -> Step {
        if segment.toggle != self.toggle {
            return Abort::TOGGLE.into();
        }
        self.received = self.received.saturating_add(segment.data.len() as u32);
        if let Err(code) = judge_size(self.size, self.received, segment.last) {
            return code.into();
        }
        if let Err(code) = dictionary.write(&segment.data) {
            return code.into();
        }
        let answer = Some(Response::DownloadSegment { toggle: self.toggle }.to_bytes());
        self.toggle = !self.toggle;
        if !segment.last {
            return Step::Go(answer);
        }
        match dictionary.finish() {
            Ok(()) => Step::End(answer),
            Err(code) => code.into(),
        }
    }
}

/// Whether as many bytes have come as were announced, or can still come.
pub(super) fn judge_size(announced: Option<u32>, received: u32, all: bool) -> Result<(), Abort> {
    match announced {
        Some(size) if received > size => Err(Abort::TOO_LONG),
        Some(size) if all && received < size => Err(Abort::TOO_SHORT),
        _ => Ok(()),
    }
}
