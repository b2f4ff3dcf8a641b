//! CSMA/CD: who talks on a line that nobody owns.
//!
//! A station listens before it talks (carrier sense), leaves a gap, and compares what it hears of itself with what it says.
//! Where the two differ, another talks too (collision): it stops, sends a jam so that every station notices, waits for a
//! random time (back-off) and tries again. After [`Config::attempts`] collisions in a row it gives the frame up.
//!
//! A gap must be longer than any pause inside a frame. A slot must be longer than a collision lasts, from the first bit of
//! the first station to the last of the jam: up to two characters until the first wrong one is heard, one that is under way
//! then, four of jam, and the turn-around of the transceivers. Then stations that have drawn different slots do not meet.

mod types;

use core::time::Duration;

use puente_line::Instant;

pub use types::{Action, Config, Echo, Failure, Policy, Precedence, Statistics};

use crate::Random;

/// What follows a collision: the thesis' four bytes.
pub const JAM: [u8; 4] = [0xAA; 4];

/// When a station talks.
///
/// `N` is the longest frame, at most [`crate::frame::MAX_FRAME`].
#[derive(Clone, Debug)]
pub struct Arbiter<const N: usize> {
    config: Config,
    random: Random,
    frame: heapless::Vec<u8, N>,
    precedence: Precedence,
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
            precedence: Precedence::Ordinary,
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
        precedence: Precedence,
        write: impl FnOnce(&mut heapless::Vec<u8, N>) -> Result<(), E>,
    ) -> Result<(), Option<E>> {
        let State::Idle = self.state else {
            return Err(None);
        };
        write(&mut self.frame).map_err(Some)?;
        self.precedence = precedence;
        self.state = State::Waiting { collisions: 0, backoff: Backoff::Until(now.max(self.rested_at)) };
        if now < self.turn() {
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

    /// Whether it is not on the line, for good or until its next attempt.
    pub const fn is_waiting(&self) -> bool {
        matches!(self.state, State::Waiting { .. })
    }

    /// Whether there is something to do at once: the frame has collided, or its outcome waits to be fetched.
    pub const fn is_pressing(&self) -> bool {
        matches!(self.state, State::Collided { .. } | State::Finished(_))
    }

    /// Whether its outcome waits to be fetched.
    pub const fn is_finished(&self) -> bool {
        matches!(self.state, State::Finished(_))
    }

    /// The frame in work, or the last one.
    pub fn frame(&self) -> &[u8] {
        &self.frame
    }

    /// Gives up a frame that is not on the line, for good or until its next attempt; false where there is none.
    pub fn withdraw(&mut self) -> bool {
        let waits = self.is_waiting();
        if waits {
            self.state = State::Idle;
        }
        waits
    }

    /// Puts another frame in the place of one that is not on the line. It waits as that one would have. False where there
    /// is none, and where `write` fails, after which there is none any more.
    pub fn rewrite<E>(&mut self, write: impl FnOnce(&mut heapless::Vec<u8, N>) -> Result<(), E>) -> bool {
        if !self.is_waiting() {
            return false;
        }
        let written = write(&mut self.frame).is_ok();
        if !written {
            self.state = State::Idle;
        }
        written
    }

    /// Takes a byte that the line said, the echo of what is sent too, at its end.
    pub fn receive(&mut self, now: Instant, byte: u8) {
        self.hear(now, now);
        if let (State::Transmitting { collisions, echoed, deadline }, Echo::Compared) =
            (self.state, self.config.echo)
        {
            let echoed = if self.frame.get(echoed) == Some(&byte) { Some(echoed + 1) } else { None };
            match echoed {
                Some(echoed) if echoed == self.frame.len() => self.succeed(now),
                Some(echoed) => self.state = State::Transmitting { collisions, echoed, deadline },
                None => self.state = State::Collided { collisions },
            }
        }
    }

    /// The line reported a parity, framing or overrun error.
    pub fn line_error(&mut self, now: Instant) {
        self.hear(now, now);
        if let (State::Transmitting { collisions, .. }, Echo::Compared) = (self.state, self.config.echo) {
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
                if now >= until.max(self.turn()) =>
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
            State::Transmitting { deadline, .. } if now >= deadline && self.config.echo == Echo::None => {
                self.quiet_from = self.quiet_from.max(deadline);
                self.succeed(deadline);
            }
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
            && now >= self.turn()
        {
            let until = self.turn() + time;
            self.state = State::Waiting { collisions, backoff: Backoff::Until(until) };
        }
    }

    /// When to poll again, besides after `submit` and `receive`.
    pub fn poll_at(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            State::Waiting { backoff: Backoff::For(_), .. } => Some(self.turn()),
            State::Waiting { backoff: Backoff::Until(until), .. } => Some(until.max(self.turn())),
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

    /// When the frame may go, if nothing more is heard.
    fn turn(&self) -> Instant {
        match self.precedence {
            Precedence::Answer => self.gap_ends(),
            Precedence::Ordinary => self.gap_ends() + self.config.deference,
        }
    }

    /// The line is in use now, and until `until`.
    fn hear(&mut self, now: Instant, until: Instant) {
        if now >= self.gap_ends() {
            self.busy_from = now;
        }
        self.quiet_from = until;
        // In this order: a patience takes a division, and this is for each byte.
        if matches!(self.state, State::Waiting { .. })
            && self.quiet_from.since(self.busy_from) > self.config.patience()
        {
            self.lose(Failure::LineHeld);
        }
    }

    fn transmit(&mut self, now: Instant, collisions: u8) -> Action<'_> {
        count(&mut self.statistics.attempts);
        let mut deadline = now + self.config.line.wire_time(self.frame.len());
        if self.config.echo == Echo::Compared {
            // A slot more, for what is between us and the line.
            deadline += self.config.slot + self.config.latency;
        }
        self.state = State::Transmitting { collisions, echoed: 0, deadline };
        Action::Transmit(&self.frame)
    }

    /// The frame has been on the line, whole.
    fn succeed(&mut self, now: Instant) {
        count(&mut self.statistics.frames);
        if self.precedence == Precedence::Ordinary {
            self.rested_at = now + self.config.gap + self.config.rest;
        }
        self.state = State::Finished(Ok(()));
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
