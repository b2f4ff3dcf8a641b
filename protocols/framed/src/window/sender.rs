//! The sending end of a window.

use core::fmt;

use heapless::{Deque, Vec};
use puente_line::Instant;

use super::timeout::Timeout;
use super::{Cause, Config, Outcome};
use crate::{Class, Kind, Number, Random, Reason, Session};

/// Tells a frame from all others of its sender; counted modulo 2^32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ticket(pub u32);

/// Why a frame was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refused {
    /// As many frames as there is room for are in work, or their outcomes have not been fetched.
    Full,
    /// It is longer than there is room for.
    TooLong,
    /// It does not consist of sections for the peer.
    Sections,
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Full => "the window is full",
            Self::TooLong => "the frame is too long",
            Self::Sections => "the frame does not consist of sections for its destination",
        })
    }
}

impl core::error::Error for Refused {}

/// The sending end of a window: keeps frames until they are acknowledged.
#[derive(Clone, Debug)]
pub struct Sender<const W: usize, const M: usize> {
    random: Random,
    state: State,
    /// Frames in work, by number.
    frames: Deque<Outgoing<M>, W>,
    /// Number of the first.
    base: Number,
    /// What has become of frames, until it is fetched. Together with those in work never more than `W`.
    outcomes: Deque<(Ticket, Outcome), W>,
    tickets: u32,
    /// Counts transmissions, to tell which was later; they differ by less than 2^31 at any time.
    sent: u32,
    timeout: Timeout,
    /// When the wait for an acknowledgement is over.
    deadline: Option<Instant>,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// No session, no frames.
    Closed,
    /// Asks for one.
    Opening { half: u16, tries: u8, due: bool },
    /// Has one, and the peer's room.
    Open { session: Session, window: u8 },
}

#[derive(Clone, Debug)]
struct Outgoing<const M: usize> {
    ticket: Ticket,
    class: Class,
    body: Vec<u8, M>,
    tries: u8,
    progress: Progress,
}

#[derive(Clone, Copy, Debug)]
enum Progress {
    /// To be sent.
    Due,
    /// Was sent at this time, as this transmission.
    Sent { at: Instant, order: u32 },
    /// Has arrived, but something before it has not.
    Held,
}

/// What [`Sender::next`] gave, for [`Sender::sent`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sending {
    Opening,
    Frame(Ticket),
}

impl<const W: usize, const M: usize> Sender<W, M> {
    /// A sender without a session.
    pub const fn new(seed: u64) -> Self {
        Self {
            random: Random::new(seed),
            state: State::Closed,
            frames: Deque::new(),
            base: Number::ZERO,
            outcomes: Deque::new(),
            tickets: 0,
            sent: 0,
            timeout: Timeout::new(),
            deadline: None,
        }
    }

    /// Takes a frame: its class and its sections, all for the peer.
    ///
    /// # Errors
    /// Any [`Refused`].
    pub fn submit(&mut self, class: Class, body: &[u8]) -> Result<Ticket, Refused> {
        if self.frames.len() + self.outcomes.len() >= W {
            return Err(Refused::Full);
        }
        let body = Vec::from_slice(body).map_err(|_| Refused::TooLong)?;
        let ticket = Ticket(self.tickets);
        let frame = Outgoing { ticket, class, body, tries: 0, progress: Progress::Due };
        self.frames.push_back(frame).map_err(|_| Refused::Full)?;
        self.tickets = self.tickets.wrapping_add(1);
        if let State::Closed = self.state {
            self.open();
        }
        Ok(ticket)
    }

    /// Frames in work.
    pub fn outstanding(&self) -> usize {
        self.frames.len()
    }

    /// What has become of a frame, in the order of submission.
    pub fn outcome(&mut self) -> Option<(Ticket, Outcome)> {
        self.outcomes.pop_front()
    }

    /// Whether nothing is in work.
    pub(crate) fn is_idle(&self) -> bool {
        self.frames.is_empty() && self.outcomes.is_empty()
    }

    /// Whether [`Sender::outcome`] has something.
    pub(crate) fn has_outcome(&self) -> bool {
        !self.outcomes.is_empty()
    }

    /// What to put on the line now, if anything.
    pub(crate) fn next(&self, config: &Config) -> Option<(Sending, Kind, &[u8])> {
        match self.state {
            State::Opening { half, due: true, .. } => {
                Some((Sending::Opening, Kind::Opening { sender: half }, &[]))
            }
            State::Open { session, window } => {
                let window = usize::from(window.min(config.window)).max(1);
                let mut due = (0..).zip(&self.frames).take(window);
                let (at, frame) = due.find(|(_, frame)| matches!(frame.progress, Progress::Due))?;
                let kind = Kind::Numbered { number: self.base.plus(at), class: frame.class, session };
                Some((Sending::Frame(frame.ticket), kind, &frame.body))
            }
            _ => None,
        }
    }

    /// What [`Sender::next`] gave has been on the line, or has failed to get there.
    pub(crate) fn sent(&mut self, config: &Config, now: Instant, what: Sending, arrived: bool) {
        let deadline = now + self.timeout.wait(config);
        match (what, &mut self.state) {
            (Sending::Opening, State::Opening { tries, due, .. }) => {
                *tries = tries.saturating_add(1);
                *due = false;
                self.deadline = Some(deadline);
            }
            (Sending::Frame(ticket), State::Open { .. }) => {
                let Some(frame) = self.frames.iter_mut().find(|frame| frame.ticket == ticket) else {
                    return;
                };
                frame.tries = frame.tries.saturating_add(1);
                // A copy that was acknowledged meanwhile is held.
                if let Progress::Due = frame.progress {
                    self.sent = self.sent.wrapping_add(1);
                    frame.progress = Progress::Sent { at: now, order: self.sent };
                }
                let tries = frame.tries;
                self.deadline.get_or_insert(deadline);
                if !arrived {
                    self.missing(config, ticket, tries);
                }
            }
            _ => {}
        }
    }

    /// The peer has acknowledged.
    pub(crate) fn acknowledged(&mut self, config: &Config, now: Instant, next: u8, held: u8, of: Session) {
        let State::Open { session, .. } = self.state else {
            return;
        };
        let count = next.wrapping_sub(self.base.value() as u8);
        let confirmed = usize::from(count);
        // Of another session, or older than what is known.
        if of != session || confirmed > self.frames.iter().take_while(|frame| frame.tries > 0).count() {
            return;
        }
        let held_at = |at: usize| at >= confirmed && at - confirmed < 8 && held >> (at - confirmed) & 1 == 1;
        let mut newest: Option<(u32, Instant, u8)> = None;
        let mut news = confirmed > 0;
        for (at, frame) in self.frames.iter_mut().enumerate() {
            if let Progress::Sent { at: sent, order } = frame.progress
                && (at < confirmed || held_at(at))
            {
                frame.progress = Progress::Held;
                news = true;
                if newest.is_none_or(|(other, ..)| is_later(order, other)) {
                    newest = Some((order, sent, frame.tries));
                }
            }
        }
        if !news {
            return;
        }
        for _ in 0..confirmed {
            if let Some(frame) = self.frames.pop_front() {
                let _ = self.outcomes.push_back((frame.ticket, Outcome::Confirmed));
            }
        }
        self.base = self.base.plus(count);
        self.timeout.progress();
        self.restart_timer(config, now);
        if let Some((order, sent, tries)) = newest {
            if tries == 1 {
                self.timeout.sample(now.since(sent));
            }
            self.overtaken(config, order);
        }
    }

    /// The peer has consented to a session.
    pub(crate) fn consented(&mut self, config: &Config, now: Instant, session: Session, window: u8) {
        if let State::Opening { half, .. } = self.state
            && half == session.sender
        {
            self.state = State::Open { session, window };
            self.timeout.progress();
            self.restart_timer(config, now);
        }
    }

    /// The peer has refused a frame.
    pub(crate) fn refused(&mut self, reason: Reason, of: Session) {
        match (reason, self.state) {
            (Reason::Session, State::Open { session, .. }) if session == of => self.reopen(),
            (Reason::TooLong, State::Open { session, .. }) if session == of => self.give_up(Cause::TooLong),
            (Reason::NoRoom, State::Opening { half, .. }) if half == of.sender => self.give_up(Cause::NoRoom),
            _ => {}
        }
    }

    /// Does what time alone brings about.
    pub(crate) fn elapse(&mut self, config: &Config, now: Instant) {
        if self.deadline.is_none_or(|deadline| now < deadline) {
            return;
        }
        self.deadline = None;
        self.timeout.expired();
        match &mut self.state {
            State::Closed => {}
            State::Opening { tries, .. } if *tries > config.retries => self.give_up(Cause::Silent),
            State::Opening { due, .. } => *due = true,
            State::Open { .. } => {
                // All may have arrived, and the acknowledgement be lost.
                let missing = |frame: &&Outgoing<M>| matches!(frame.progress, Progress::Sent { .. });
                let first = self.frames.iter().find(missing).or(self.frames.front());
                if let Some((ticket, tries)) = first.map(|frame| (frame.ticket, frame.tries)) {
                    self.missing(config, ticket, tries);
                }
            }
        }
    }

    /// When [`Sender::elapse`] has something to do.
    pub(crate) fn elapse_at(&self) -> Option<Instant> {
        self.deadline
    }

    /// A frame has to be repeated, or the peer to be given up.
    fn missing(&mut self, config: &Config, ticket: Ticket, tries: u8) {
        if tries > config.retries {
            return self.give_up(Cause::Silent);
        }
        if let Some(frame) = self.frames.iter_mut().find(|frame| frame.ticket == ticket) {
            frame.progress = Progress::Due;
        }
    }

    /// What was sent before transmission `order`, which has arrived, is lost.
    fn overtaken(&mut self, config: &Config, order: u32) {
        let mut tries = 0;
        for frame in &mut self.frames {
            if let Progress::Sent { order: earlier, .. } = frame.progress
                && is_later(order, earlier)
            {
                frame.progress = Progress::Due;
                tries = tries.max(frame.tries);
            }
        }
        if tries > config.retries {
            self.give_up(Cause::Silent);
        }
    }

    fn restart_timer(&mut self, config: &Config, now: Instant) {
        let waits = self.frames.iter().any(|frame| !matches!(frame.progress, Progress::Due));
        self.deadline = waits.then(|| now + self.timeout.wait(config));
    }

    fn open(&mut self) {
        let half = (self.random.next() as u16).max(1);
        self.state = State::Opening { half, tries: 0, due: true };
        self.base = Number::ZERO;
        self.deadline = None;
    }

    /// The peer has forgotten the session: what was sent is uncertain, the rest goes into another.
    fn reopen(&mut self) {
        while self.frames.front().is_some_and(|frame| frame.tries > 0) {
            self.report_first(Cause::Restarted);
        }
        match self.frames.is_empty() {
            true => self.close(),
            false => self.open(),
        }
    }

    /// Ends the session, and with it all frames.
    fn give_up(&mut self, cause: Cause) {
        while !self.frames.is_empty() {
            self.report_first(cause);
        }
        self.close();
    }

    fn report_first(&mut self, cause: Cause) {
        if let Some(frame) = self.frames.pop_front() {
            let outcome = match frame.tries {
                0 => Outcome::NotSent(cause),
                _ => Outcome::Unconfirmed(cause),
            };
            let _ = self.outcomes.push_back((frame.ticket, outcome));
        }
    }

    fn close(&mut self) {
        self.state = State::Closed;
        self.deadline = None;
    }
}

/// Whether transmission `a` came after `b`.
const fn is_later(a: u32, b: u32) -> bool {
    a.wrapping_sub(b).wrapping_sub(1) < u32::MAX / 2
}
