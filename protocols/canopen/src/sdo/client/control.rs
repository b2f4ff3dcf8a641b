//! How a transfer ends otherwise than by itself, or waits; and who is asked next.

use puente_line::Instant;

use super::{Client, Failure, State};
use crate::NodeId;

impl Client {
    /// Asks the first SDO server of another node from now on, without any debt of the last one. Not while it is busy.
    pub fn serve(&mut self, node: NodeId) {
        if self.is_busy() {
            return;
        }
        self.request = node.sdo_request();
        self.response = node.sdo_response();
        self.abort = None;
        self.quiet_until = Instant::ZERO;
        self.owes_one = false;
    }

    /// Whether a read waits before each segment, or each block: its caller has no room for it, which is as long as
    /// [`Config::block`](super::Config::block) says and a segment more. A block under way is not held up. Ends with the transfer.
    ///
    /// The time that a server waits is its own matter.
    pub const fn pause(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// Gives the transfer up; the server is told where it knows of it.
    pub fn cancel(&mut self, now: Instant) {
        self.end(now, Failure::Cancelled);
    }

    /// Ends the transfer like this, as [`Client::cancel`] does.
    pub fn end(&mut self, now: Instant, failure: Failure) {
        match (self.state, failure) {
            (State::Idle | State::Finished(_), _) => {}
            (State::Queued, Failure::Cancelled) => self.state = State::Finished(Err(Failure::NotSent)),
            (State::Queued | State::Ready | State::Waiting | State::Settling { .. }, _) => {
                self.give_up(now, failure);
            }
        }
    }

    /// The server has booted: it owes nothing any more, and what was in work has failed.
    pub fn booted(&mut self, now: Instant) {
        self.end(now, Failure::Booted);
        self.abort = None;
        self.quiet_until = now;
        self.owes_one = false;
    }

    /// Whether something of the last transfer was asked again, so that it may be answered twice.
    pub const fn has_repeated(&self) -> bool {
        self.repeated
    }

    /// Until when it asks for nothing else; `None` while a transfer is in work or the server is to be told of its end.
    pub fn quiet_until(&self) -> Option<Instant> {
        (!self.is_busy() && self.abort.is_none()).then_some(self.quiet_until)
    }
}
