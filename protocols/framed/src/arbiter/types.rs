//! What goes into an arbiter and comes out of it.

use core::fmt;
use core::time::Duration;

use puente_line::Settings;

use crate::Random;
use crate::frame::MAX_FRAME;

/// How a station behaves on the line; all on a line alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Baud rate and format.
    pub line: Settings,
    /// Silence before a frame, the inter-packet gap.
    pub gap: Duration,
    /// What a frame that answers nothing leaves in addition, so that answers go first, as with the two gaps of IEEE 802.11:
    /// more than it takes to notice that another has begun, for a receiver that tells of whole characters only.
    pub deference: Duration,
    /// Unit of the back-off.
    pub slot: Duration,
    /// What a station adds to the gap after a frame of its own. IEEE 802.3 has no such thing, and there a station that has
    /// just sent meets all that waited for it without a back-off, wins again and again, and starves them. With a slot,
    /// those that wait come first, and so does the answer to the frame. After an answer there is no rest: another has asked.
    pub rest: Duration,
    /// Collisions in a row after which a frame is given up, at least 1.
    pub attempts: u8,
    /// How the back-off grows.
    pub policy: Policy,
    /// Whether the station hears itself.
    pub echo: Echo,
    /// What the port takes, on the way out and back together, beyond the time on the line. An echo may be late by so much.
    pub latency: Duration,
}

impl Config {
    /// For a line: a gap of 2 characters, a deference of 2, a slot of 8, a slot of rest, 16 attempts, [`Policy::Truncated`],
    /// [`Echo::Compared`], no latency.
    pub fn new(line: Settings) -> Self {
        Self {
            line,
            gap: line.wire_time(2),
            deference: line.wire_time(2),
            slot: line.wire_time(8),
            rest: line.wire_time(8),
            attempts: 16,
            policy: Policy::Truncated,
            echo: Echo::Compared,
            latency: Duration::ZERO,
        }
    }

    /// No frame is longer, and what collides with it ends with it: a line that has been in use for so long without a gap
    /// is held by something that is no station.
    pub fn patience(&self) -> Duration {
        self.line.wire_time(2 * MAX_FRAME)
    }
}

/// Who goes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precedence {
    /// The answer to a frame that has just been on the line: after a gap.
    Answer,
    /// Everything else: after [`Config::deference`] more.
    Ordinary,
}

/// Whether a station hears itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Echo {
    /// It does, and compares.
    Compared,
    /// It does not, as with an adapter that switches its receiver off while it sends. A frame counts as sent after its time
    /// on the line; no collision is seen, and a frame that met one is lost unless it is one of a window.
    None,
}

/// How long a station waits after its n-th collision in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Policy {
    /// Truncated binary exponential back-off, as in IEEE 802.3: r slots, r uniform below 2^min(n, 10).
    Truncated,
    /// CW x random x gap, where the contention window CW is 1 at first, doubles with each collision without a limit, and
    /// random is uniform from 0 to 1. The thesis' code has (CW - 1) x rand() x IPG, never sets CW back and has its first
    /// value in a file that is not printed; its comment has CW x rand() x slot. Here CW begins anew with each frame.
    Thesis,
}

impl Policy {
    pub(super) fn backoff(self, collisions: u8, config: &Config, random: &mut Random) -> Duration {
        match self {
            Self::Truncated => config.slot.saturating_mul(random.bits(u32::from(collisions).min(10))),
            Self::Thesis => {
                let window = 1_u128 << u32::from(collisions).min(64);
                let gaps = window * u128::from(random.next());
                let micros = config.gap.as_micros().saturating_mul(gaps) >> 32;
                Duration::from_micros(u64::try_from(micros).unwrap_or(u64::MAX))
            }
        }
    }
}

/// Why a frame did not get onto the line. The station can be used as before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// Every attempt collided.
    Collisions {
        /// So many.
        attempts: u8,
    },
    /// The line has been in use without a gap for [`Config::patience`], since the frame came.
    LineHeld,
    /// The station does not hear itself. One that cannot listen must not talk, so it does not try again, and keeps quiet for
    /// [`Config::patience`] whatever it is given.
    NoEcho,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Collisions { attempts } => write!(f, "{attempts} attempts in a row collided"),
            Self::LineHeld => f.write_str("something holds the line without a gap"),
            Self::NoEcho => f.write_str("the station does not hear itself"),
        }
    }
}

impl core::error::Error for Failure {}

/// What the caller has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action<'a> {
    /// Send these bytes, now and without a pause, and keep listening.
    Transmit(&'a [u8]),
    /// Stop sending, with the character that is under way, and send this instead.
    Jam(&'static [u8]),
    /// The frame is done.
    Done(Result<(), Failure>),
    /// Nothing until something is heard, or the time of [`crate::Arbiter::poll_at`].
    Idle,
}

/// Events since start-up, each modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// Frames that got onto the line whole.
    pub frames: u32,
    /// Times that a frame was begun.
    pub attempts: u32,
    /// Attempts that collided, or met noise, which looks alike.
    pub collisions: u32,
    /// Frames that found the line in use when they came.
    pub deferrals: u32,
    /// All back-offs together.
    pub backoff: Duration,
    /// Frames given up.
    pub losses: u32,
}
