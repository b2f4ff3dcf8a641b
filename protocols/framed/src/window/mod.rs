//! Sliding windows: frames that arrive once and in order, or are reported lost.
//!
//! Each direction between two stations has a window of its own. Up to eight frames are outstanding; what is missing is repeated
//! alone (selective repeat). Memory is bounded: `W` frames of at most `M` bytes at either end of each.
//!
//! # Sessions
//! A station that starts anew counts its frames from 0 again, and frames of its past may still come. So numbers count within
//! a *session*, which both ends have a half of, drawn at random:
//!
//! ```text
//! sender    Opening s  -->            draws s
//!           <--  Consent s, r         the receiver draws r
//!           frame 0 of (s, r)  -->    only now the receiver leaves its last session
//! ```
//! - A frame of the past has another s or r, and is not delivered. A repeated or late opening moves nothing: only the sender
//!   that lives knows the r just drawn.
//! - A receiver that has started anew refuses frames of a session that it does not know. The sender reports what it had sent
//!   as unconfirmed, since that may or may not have had its effect, and opens another session for the rest.
//! - A sender that has started anew opens another session, which ends the old one.
//!
//! # Loss
//! A frame is taken for lost when one that was sent later has arrived, for the line keeps the order; or after a timeout
//! that follows the round-trip time (RFC 6298). After [`Config::retries`] repetitions the peer is given up: every frame is
//! reported, as unconfirmed where it has been on the line, as not sent where it has not. None is lost in silence, and none
//! is sent again without its receiver being able to tell.

mod receiver;
mod sender;
mod timeout;

use core::fmt;
use core::time::Duration;

use puente_line::Settings;

pub(crate) use receiver::Receiver;
pub use sender::{Refused, Ticket};
pub(crate) use sender::{Sender, Sending};

/// Frames of the largest window: half as many as there are numbers.
pub const MAX_WINDOW: usize = 8;

/// How windows behave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Frames outstanding at most, 1 to [`MAX_WINDOW`]; the room at both ends limits it too.
    pub window: u8,
    /// Times that a frame is repeated before its peer is given up. 0 switches the repetition off, not the reports.
    pub retries: u8,
    /// Wait for an acknowledgement before any round-trip time is known.
    pub first_timeout: Duration,
    /// Bounds of the wait.
    pub min_timeout: Duration,
    /// Bounds of the wait.
    pub max_timeout: Duration,
    /// So long a receiver waits for more frames before it acknowledges; it does so at once when half a window has come, or
    /// when something is missing or comes twice.
    pub acknowledge_after: Duration,
}

impl Config {
    /// For a line and frames of at most `longest` bytes: windows of 8, 15 repetitions, timeouts of 16 such frames at first, 4
    /// at least and a second at most, acknowledgements after one. A peer that is dead at 1 Mbit/s is given up after some
    /// ten seconds: on a saturated line a living one may not get a word in for more than one.
    pub fn new(line: Settings, longest: usize) -> Self {
        Self {
            window: MAX_WINDOW as u8,
            retries: 15,
            first_timeout: line.wire_time(16 * longest),
            min_timeout: line.wire_time(4 * longest),
            max_timeout: Duration::from_secs(1).max(line.wire_time(16 * longest)),
            acknowledge_after: line.wire_time(longest),
        }
    }
}

/// What became of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It was delivered, once and in its place.
    Confirmed,
    /// It was sent, and may or may not have been delivered.
    Unconfirmed(Cause),
    /// It was never on the line.
    NotSent(Cause),
}

/// Why a frame was not confirmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The peer did not acknowledge it, however often it was repeated.
    Silent,
    /// The peer has started anew since.
    Restarted,
    /// The peer cannot take frames of this length.
    TooLong,
    /// The peer has no room for another sender.
    NoRoom,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Silent => "the station does not answer",
            Self::Restarted => "the station has started anew",
            Self::TooLong => "the station cannot take frames of this length",
            Self::NoRoom => "the station has no room for another sender",
        })
    }
}
