//! A station's place on the line, and what it is sending.

use std::collections::VecDeque;
use std::time::Duration;

use puente_line::Settings;

use crate::heard::{Drive, Node};
use crate::judge::Record;
use crate::medium::Receiver;

/// How a station notices that another is talking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// By the start bit, as a UART that can tell whether it is receiving.
    StartBit,
    /// By whole characters.
    Character,
}

/// A station's place on the line, and its transceiver.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Time that a signal takes from the line's end to here.
    pub position: Duration,
    /// Shortest time from a station's decision to its first bit on the line.
    pub turnaround: Duration,
    /// At most so much is added to it, at random.
    pub jitter: Duration,
    /// How it notices others.
    pub sense: Sense,
    /// It hears nothing.
    pub deaf: bool,
    /// It hears itself. Without, its receiver is off while it sends.
    pub echo: bool,
    /// Nobody hears it: what it sends gets no further than its transmitter.
    pub mute: bool,
    /// Its manners are watched.
    pub judged: bool,
}

impl Place {
    /// At a line's beginning, a transceiver that takes 1 to 2 bit times at `line`'s rate, start bits noticed, judged.
    pub fn new(line: Settings) -> Self {
        let bit = Duration::from_nanos(bit_time(line));
        Self {
            position: Duration::ZERO,
            turnaround: bit,
            jitter: bit,
            sense: Sense::StartBit,
            deaf: false,
            echo: true,
            mute: false,
            judged: true,
        }
    }
}

/// A station with its place.
pub(crate) struct Seat<N> {
    pub node: N,
    pub place: Place,
    pub receiver: Receiver,
    pub record: Record,
    /// When the station wants to be polled; `u64::MAX` for never.
    pub wake: u64,
    pub idle_polls: u32,
    pub talk: Option<Talk>,
}

/// What a station is sending.
pub(crate) struct Talk {
    /// The bytes that have not begun.
    pub bytes: VecDeque<u8>,
    /// When the next one begins, or, after the last, when that ends.
    pub at: u64,
    pub jam: bool,
    /// The byte begun last.
    pub last: Option<u8>,
}

impl Talk {
    fn new(bytes: Vec<u8>, at: u64, jam: bool) -> Self {
        Self { bytes: bytes.into(), at, jam, last: None }
    }
}

impl<N: Node> Seat<N> {
    /// Joins at `now`.
    pub fn new(node: N, place: Place, now: u64) -> Self {
        let (receiver, record) = (Receiver::default(), Record::default());
        Self { node, place, receiver, record, wake: now, idle_polls: 0, talk: None }
    }

    /// Sends something, from `at` on if the transmitter is off.
    pub fn drive(&mut self, drive: Drive, at: u64) {
        match (drive, &mut self.talk) {
            (Drive::Transmit(bytes), Some(talk)) => talk.bytes.extend(bytes),
            (Drive::Transmit(bytes), None) => self.talk = Some(Talk::new(bytes, at, false)),
            // Not even one character may have begun: then nothing is left of them.
            (Drive::Jam(bytes), Some(talk)) => *talk = Talk::new(bytes, talk.at, true),
            (Drive::Jam(bytes), None) => self.talk = Some(Talk::new(bytes, at, true)),
            (Drive::Discard, Some(talk)) => talk.bytes.clear(),
            (Drive::Discard, None) => {}
        }
    }

    /// Whether its receiver is on.
    pub fn listens(&self) -> bool {
        !self.place.deaf && (self.place.echo || self.talk.is_none())
    }

    /// The node has heard something at `now`: when does it want to be polled?
    pub fn wake_after(&mut self, now: u64) {
        let at = self.node.poll_at();
        self.wake = at.map_or(u64::MAX, |at| at.as_micros().saturating_mul(1_000).max(now));
    }
}

/// Nanoseconds.
pub(crate) fn bit_time(line: Settings) -> u64 {
    1_000_000_000 / u64::from(line.baud.max(1))
}
