//! CSMA/CD: who talks on a line that nobody owns.
//!
//! A station listens before it talks (carrier sense), leaves a gap, and compares what it hears of itself with what it says.
//! Where the two differ, another talks too (collision): it stops, sends a jam so that every station notices, waits for a
//! random time (back-off) and tries again. After [`Config::attempts`] collisions in a row it gives the frame up.
//!
//! A gap must be longer than any pause inside a frame. A slot must be longer than a collision lasts, from the first bit of
//! the first station to the last of the jam: up to two characters until the first wrong one is heard, one that is under way
//! then, four of jam, and the turn-around of the transceivers. Then stations that have drawn different slots do not meet.

use core::fmt;
use core::time::Duration;

use puente_line::{Instant, Settings};

use crate::Random;
use crate::frame::MAX_FRAME;

/// What follows a collision: the thesis' four bytes.
pub const JAM: [u8; 4] = [0xAA; 4];

/// How a station behaves on the line; all on a line alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Baud rate and format.
    pub line: Settings,
    /// Silence before a frame, the inter-packet gap.
    pub gap: Duration,
    /// Unit of the back-off.
    pub slot: Duration,
    /// What a station adds to the gap after a frame of its own. IEEE 802.3 has no such thing, and there a station that has
    /// just sent meets all that waited for it without a back-off, wins again and again, and starves them. With a slot,
    /// those that wait come first, and so does the answer to the frame.
    pub rest: Duration,
    /// Collisions in a row after which a frame is given up, at least 1.
    pub attempts: u8,
    /// How the back-off grows.
    pub policy: Policy,
}

impl Config {
    /// For a line: a gap of 2 characters, a slot of 8, a slot of rest, 16 attempts, [`Policy::Truncated`].
    pub fn new(line: Settings) -> Self {
        Self {
            line,
            gap: line.wire_time(2),
            slot: line.wire_time(8),
            rest: line.wire_time(8),
            attempts: 16,
            policy: Policy::Truncated,
        }
    }

    /// No frame is longer, and what collides with it ends with it: a line that has been in use for so long without a gap
    /// is held by something that is no station.
    pub fn patience(&self) -> Duration {
        self.line.wire_time(2 * MAX_FRAME)
    }
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
    fn backoff(self, collisions: u8, config: &Config, random: &mut Random) -> Duration {
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

/// The last frame is still in work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy;

impl fmt::Display for Busy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the station has a frame in work")
    }
}

impl core::error::Error for Busy {}

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
            Self::NoEcho => {
                f.write_str("the station does not hear itself; is its receiver on while it sends?")
            }
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
    /// Nothing until something is heard, or the time of [`Arbiter::poll_at`].
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

/// When a station talks.
///
/// `N` is the longest frame, at most [`MAX_FRAME`].
#[derive(Clone, Debug)]
pub struct Arbiter<const N: usize> {
    config: Config,
    random: Random,
    frame: heapless::Vec<u8, N>,
    state: State,
    /// Since when, or from when on, the line is silent.
    quiet_from: Instant,
    /// Since when it has not been, without a gap, while the frame waits.
    busy_from: Instant,
    /// When the rest after our own last frame is over.
    rested_at: Instant,
    statistics: Statistics,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// No frame.
    Idle,
    /// The line must have been silent for a gap, and the back-off must be over.
    Waiting { collisions: u8, backoff: Backoff },
    /// So many bytes have been heard; all must have been by `deadline`.
    Transmitting { collisions: u8, echoed: usize, deadline: Instant },
    /// What was heard differs; the jam is due.
    Collided { collisions: u8 },
    /// The jam is on the line.
    Jamming { collisions: u8, until: Instant },
    /// The outcome has not been fetched.
    Finished(Result<(), Failure>),
}

#[derive(Clone, Copy, Debug)]
enum Backoff {
    /// Begins with the end of the next gap, which all stations hear at the same time.
    For(Duration),
    /// Has begun. It goes on whether or not the line is in use.
    Until(Instant),
}

impl<const N: usize> Arbiter<N> {
    /// A station of a line, on which something may be under way. Its seed must be another than that of any other station.
    pub const fn new(config: Config, now: Instant, seed: u64) -> Self {
        Self {
            config,
            random: Random::new(seed),
            frame: heapless::Vec::new(),
            state: State::Idle,
            quiet_from: now,
            busy_from: now,
            rested_at: now,
            statistics: Statistics {
                frames: 0,
                attempts: 0,
                collisions: 0,
                deferrals: 0,
                backoff: Duration::ZERO,
                losses: 0,
            },
        }
    }

    /// Takes a frame, which `write` puts into the buffer; nothing happens where that fails.
    ///
    /// # Errors
    /// `None` until the outcome of the last frame has been fetched, what `write` says after that.
    pub fn submit<E>(
        &mut self,
        now: Instant,
        write: impl FnOnce(&mut heapless::Vec<u8, N>) -> Result<(), E>,
    ) -> Result<(), Option<E>> {
        let State::Idle = self.state else {
            return Err(None);
        };
        write(&mut self.frame).map_err(Some)?;
        self.state = State::Waiting { collisions: 0, backoff: Backoff::Until(now.max(self.rested_at)) };
        if now < self.gap_ends() {
            count(&mut self.statistics.deferrals);
            // It has its own time to wait: were it given up at once, its owner would try for ever.
            self.busy_from = now;
        }
        Ok(())
    }

    /// Whether a frame is in work.
    pub const fn is_busy(&self) -> bool {
        !matches!(self.state, State::Idle)
    }

    /// Whether its outcome waits to be fetched.
    pub const fn is_finished(&self) -> bool {
        matches!(self.state, State::Finished(_))
    }

    /// Takes a byte that the line said, the echo of what is sent too, at its end.
    pub fn receive(&mut self, now: Instant, byte: u8) {
        self.hear(now, now);
        if let State::Transmitting { collisions, echoed, deadline } = self.state {
            let echoed = if self.frame.get(echoed) == Some(&byte) { Some(echoed + 1) } else { None };
            self.state = match echoed {
                Some(echoed) if echoed == self.frame.len() => {
                    count(&mut self.statistics.frames);
                    self.rested_at = now + self.config.gap + self.config.rest;
                    State::Finished(Ok(()))
                }
                Some(echoed) => State::Transmitting { collisions, echoed, deadline },
                None => State::Collided { collisions },
            };
        }
    }

    /// The line reported a parity, framing or overrun error.
    pub fn line_error(&mut self, now: Instant) {
        self.hear(now, now);
        if let State::Transmitting { collisions, .. } = self.state {
            self.state = State::Collided { collisions };
        }
    }

    /// A character is arriving. A port that can tell says so before [`Arbiter::poll`]; that saves the collisions with
    /// characters that have begun but not ended.
    pub fn carrier(&mut self, now: Instant) {
        self.hear(now, now + self.config.line.wire_time(1));
    }

    /// What to do now.
    pub fn poll(&mut self, now: Instant) -> Action<'_> {
        self.elapse(now);
        match self.state {
            State::Waiting { collisions, backoff: Backoff::Until(until) }
                if now >= until.max(self.gap_ends()) =>
            {
                self.transmit(now, collisions)
            }
            State::Collided { collisions } => {
                let until = now + self.config.line.wire_time(1 + JAM.len());
                self.state = State::Jamming { collisions, until };
                Action::Jam(&JAM)
            }
            State::Finished(outcome) => {
                self.state = State::Idle;
                Action::Done(outcome)
            }
            _ => Action::Idle,
        }
    }

    /// Does what time alone brings about.
    pub(crate) fn elapse(&mut self, now: Instant) {
        match self.state {
            State::Transmitting { echoed: 0, deadline, .. } if now >= deadline => {
                self.rested_at = now + self.config.patience();
                self.lose(Failure::NoEcho);
            }
            // The end was not heard, but it is over: nothing is left to be jammed.
            State::Transmitting { collisions, deadline, .. } if now >= deadline => self.back_off(collisions),
            State::Jamming { collisions, until } if now >= until => self.back_off(collisions),
            _ => {}
        }
        if let State::Waiting { collisions, backoff: Backoff::For(time) } = self.state
            && now >= self.gap_ends()
        {
            let until = self.gap_ends() + time;
            self.state = State::Waiting { collisions, backoff: Backoff::Until(until) };
        }
    }

    /// When to poll again, besides after `submit` and `receive`.
    pub fn poll_at(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            State::Waiting { backoff: Backoff::For(_), .. } => Some(self.gap_ends()),
            State::Waiting { backoff: Backoff::Until(until), .. } => Some(until.max(self.gap_ends())),
            State::Transmitting { deadline, .. } => Some(deadline),
            State::Jamming { until, .. } => Some(until),
            State::Collided { .. } | State::Finished(_) => Some(Instant::ZERO),
        }
    }

    /// What has happened since start-up.
    pub const fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// When a gap has passed, if nothing more is heard.
    fn gap_ends(&self) -> Instant {
        self.quiet_from + self.config.gap
    }

    /// The line is in use now, and until `until`.
    fn hear(&mut self, now: Instant, until: Instant) {
        if now >= self.gap_ends() {
            self.busy_from = now;
        }
        self.quiet_from = until;
        let held = self.quiet_from.since(self.busy_from) > self.config.patience();
        if held && matches!(self.state, State::Waiting { .. }) {
            self.lose(Failure::LineHeld);
        }
    }

    fn transmit(&mut self, now: Instant, collisions: u8) -> Action<'_> {
        count(&mut self.statistics.attempts);
        // A slot more, for what is between us and the line.
        let deadline = now + self.config.line.wire_time(self.frame.len()) + self.config.slot;
        self.state = State::Transmitting { collisions, echoed: 0, deadline };
        Action::Transmit(&self.frame)
    }

    /// The attempt is over; another one follows, or not.
    fn back_off(&mut self, collisions: u8) {
        count(&mut self.statistics.collisions);
        let collisions = collisions.saturating_add(1);
        if collisions >= self.config.attempts {
            self.lose(Failure::Collisions { attempts: collisions });
        } else {
            let backoff = self.config.policy.backoff(collisions, &self.config, &mut self.random);
            self.statistics.backoff = self.statistics.backoff.saturating_add(backoff);
            self.state = State::Waiting { collisions, backoff: Backoff::For(backoff) };
        }
    }

    fn lose(&mut self, failure: Failure) {
        count(&mut self.statistics.losses);
        self.state = State::Finished(Err(failure));
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
