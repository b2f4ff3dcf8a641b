//! What goes into a station and comes out of it.

use core::fmt;
use core::time::Duration;

use puente_line::Settings;

use crate::arbiter::{self, Failure};
use crate::frame::{Class, EmitError, Frame, FrameError};
use crate::window::{self, Outcome, Ticket};

/// How a station works.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Its address, 1 to 254.
    pub address: u8,
    /// Its manners on the line.
    pub arbiter: arbiter::Config,
    /// Its windows.
    pub window: window::Config,
    /// After so long a silence a frame that is incomplete is void. A port that hands bytes on in bursts needs more than the
    /// arbiter's gap: its latency too.
    pub silence: Duration,
    /// Whether it hands over what others say to each other in their windows, too.
    pub promiscuous: bool,
}

impl Config {
    /// For a line and frames of at most `longest` bytes: [`arbiter::Config::new`], [`window::Config::new`], void after a gap.
    pub fn new(address: u8, line: Settings, longest: usize) -> Self {
        let arbiter = arbiter::Config::new(line);
        Self {
            address,
            arbiter,
            window: window::Config::new(line, longest),
            silence: arbiter.gap,
            promiscuous: false,
        }
    }
}

/// What the caller has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action<'a> {
    /// Send these bytes, now and without a pause, and keep listening.
    Transmit(&'a [u8]),
    /// Stop sending, with the character that is under way, and send this instead.
    Jam(&'static [u8]),
    /// A frame of a window, once and in order.
    Received {
        /// The station that sent it.
        from: u8,
        /// What it carries.
        class: Class,
        /// Its sections.
        body: &'a [u8],
    },
    /// A frame outside of any window, of the thesis or not, whoever it is for; see [`Config::promiscuous`].
    Heard(Frame<'a>),
    /// What has become of a frame of a window.
    Done {
        /// The station that it was for.
        to: u8,
        /// Which frame.
        ticket: Ticket,
        /// What has become of it.
        outcome: Outcome,
    },
    /// What has become of the frame of [`crate::Station::post`]. That it was on the line does not mean that anyone has understood it.
    Posted(Result<(), Failure>),
    /// Something that was not posted is off the line. Who wants to post something does so before the next poll, or the windows
    /// may go first.
    Free,
    /// Nothing until something is heard, or the time of [`crate::Station::poll_at`].
    Idle,
}

/// Why a frame was not taken to be posted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PostError {
    /// Another one is in work.
    Busy,
    /// It cannot be made, or is too long for this station.
    Unmade(EmitError),
    /// The bytes are no frame.
    NoFrame(FrameError),
}

impl fmt::Display for PostError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Busy => f.write_str("the station has a frame in work"),
            Self::Unmade(why) => why.fmt(f),
            Self::NoFrame(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for PostError {}
