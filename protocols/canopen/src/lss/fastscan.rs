//! Fastscan: an identity found bit by bit.

use super::{Failure, Identity, Part, Request};

/// What is known of the node that is looked for; `None` is found out, in 33 questions each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Known {
    /// Vendor-ID.
    pub vendor: Option<u32>,
    /// Product code.
    pub product: Option<u32>,
    /// Revision number.
    pub revision: Option<u32>,
    /// Serial number.
    pub serial: Option<u32>,
}

impl Known {
    /// One of its values.
    pub const fn part(&self, part: Part) -> Option<u32> {
        match part {
            Part::Vendor => self.vendor,
            Part::Product => self.product,
            Part::Revision => self.revision,
            Part::Serial => self.serial,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Whether there is anybody.
    Start,
    /// Whether this bit of the part is 0.
    Bit(Part, u8),
    /// Whether the part is right; who it is goes on to the next one.
    Check(Part),
}

/// A scan: a question, and whether anybody answers it in time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fastscan {
    known: Known,
    step: Step,
    found: Identity,
}

impl Fastscan {
    pub const fn new(known: Known) -> Self {
        Self { known, step: Step::Start, found: Identity { vendor: 0, product: 0, revision: 0, serial: 0 } }
    }

    pub const fn question(&self) -> Request {
        match self.step {
            Step::Start => Request::Fastscan { id: 0, bit: Request::START, part: 0, next: 0 },
            Step::Bit(part, bit) => {
                Request::Fastscan { id: self.found.part(part), bit, part: part as u8, next: part as u8 }
            }
            Step::Check(part) => {
                // After the last part a next one below it puts the node into configuration.
                let next = (part as u8 + 1) % 4;
                Request::Fastscan { id: self.found.part(part), bit: 0, part: part as u8, next }
            }
        }
    }

    /// Whether the question was answered; the end where it was the last.
    pub fn heard(&mut self, answered: bool) -> Option<Result<Identity, Failure>> {
        self.step = match (self.step, answered) {
            (Step::Start, false) => return Some(Err(Failure::Nobody)),
            (Step::Start, true) => self.begin(Part::Vendor),
            (Step::Bit(part, bit), answered) => {
                if !answered {
                    self.found.set(part, self.found.part(part) | 1 << (bit & 31));
                }
                if bit == 0 { Step::Check(part) } else { Step::Bit(part, bit - 1) }
            }
            (Step::Check(_), false) => return Some(Err(Failure::Vanished)),
            (Step::Check(part), true) => match Part::from_number(part as u8 + 1) {
                Some(next) => self.begin(next),
                None => return Some(Ok(self.found)),
            },
        };
        None
    }

    const fn begin(&mut self, part: Part) -> Step {
        match self.known.part(part) {
            Some(value) => {
                self.found.set(part, value);
                Step::Check(part)
            }
            None => Step::Bit(part, 31),
        }
    }
}
