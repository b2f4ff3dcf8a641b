//! The duty of whoever has taken an axis from its commander.

use super::Desk;
use super::lease::{Cause, Stopping};

/// The duty to stop an axis that may move. Dropped before it is [`done`](Duty::done) it falls to the watchman.
#[must_use]
pub struct Duty<'d> {
    pub(super) desk: &'d Desk,
    pub(super) axis: u8,
    /// The axis' epoch that began with the duty.
    pub(super) epoch: u32,
}

impl Duty<'_> {
    /// The drive has confirmed the stop.
    pub fn done(self) {
        self.desk.end_stopping(self.axis, self.epoch, Stopping::Done);
    }
}

impl Drop for Duty<'_> {
    fn drop(&mut self) {
        let owed = Stopping::Owed(Cause::StopUnconfirmed);
        self.desk.end_stopping(self.axis, self.epoch, owed);
    }
}
