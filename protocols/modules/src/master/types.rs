//! What goes into a master and comes out of it.

use core::time::Duration;

use puente_drives::pid::{Event, Gains};
use puente_framed::arbiter::{self, Failure};
use puente_framed::station;

use crate::{Control, Form, Report};

/// A module on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Its address, 1 to 254.
    pub address: u8,
    /// How its settings are written.
    pub form: Form,
}

/// How a master works.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Its station.
    pub station: station::Config,
    /// From one cycle to the next. As many modules are asked in each, in turn, as 80 % of it has room for, but at least one.
    /// With zero all are asked, and one cycle follows the other at once.
    pub cycle: Duration,
}

/// What is wanted of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Output {
    /// What it shall be at.
    pub control: Control,
    /// The gains of its loop; see [`crate::setting::check`]. Those that cannot be written are sent as 0, which a module
    /// refuses.
    pub gains: Gains,
    /// Where it shall go, counts; held within [`crate::MAX_SET_POINT`].
    pub set_point: i32,
}

/// What the caller has to do, or to know.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action<'a> {
    /// Send these bytes, now and without a pause, and keep listening.
    Transmit(&'a [u8]),
    /// Stop sending, with the character that is under way, and send this instead.
    Jam(&'static [u8]),
    /// What an axis is at, since it was asked.
    Reported {
        /// Its place in the order of [`super::Master::new`].
        axis: usize,
        /// What it is at.
        report: Report,
        /// It answers a frame that said what is wanted now, but for the set-point; otherwise it may tell of what was
        /// before.
        current: bool,
    },
    /// An axis that was asked has not answered in time. It still may.
    Missed {
        /// Its place.
        axis: usize,
    },
    /// The frame of a cycle was given up: see [`Statistics::failure`].
    Failed,
    /// What an axis that this master commands tells.
    Event {
        /// Its place.
        axis: usize,
        /// What has happened.
        event: Event,
    },
    /// What is wanted of an axis has been taken back: it has lost its current by itself, or another has stopped it.
    Fell {
        /// Its place.
        axis: usize,
        /// What is wanted now: Observe after the one, Hold after the other.
        to: Control,
    },
    /// A whole frame on the line that is none of the master's own business.
    Heard(&'a [u8]),
    /// What has become of the frame of [`super::Master::post`]. That it was on the line does not mean that anyone has understood it.
    Posted(Result<(), Failure>),
    /// Nothing until something is heard, or the time of [`super::Master::poll_at`].
    Idle,
}

/// Events since start-up, each modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// What the station has met on the line.
    pub line: arbiter::Statistics,
    /// Cycles whose frame was on the line.
    pub cycles: u32,
    /// Cycles whose frame was given up.
    pub failed: u32,
    /// Why the last cycle's frame was given up; none where it was on the line.
    pub failure: Option<Failure>,
    /// Cycles that became due while the one before was still in work.
    pub overruns: u32,
    /// Reports that were asked for and did not come.
    pub missed: u32,
    /// From the end of one cycle's frame to the end of the next: the last one, zero before the second.
    pub last_cycle: Duration,
    /// The longest of these.
    pub longest_cycle: Duration,
}
