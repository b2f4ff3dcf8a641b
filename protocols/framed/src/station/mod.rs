//! A station: decoder, arbiter and windows together.

mod links;
mod post;
mod types;

use heapless::Vec;
use puente_line::Instant;

pub use types::{Action, Config, PostError};

use crate::arbiter::{self, Arbiter, Precedence, Statistics};
use crate::frame::{self, Frame, Kind};
use crate::section::{self, Sections};
use links::Link;

use crate::window::{self, Receiver, Refused, Sender, Ticket};
use crate::{Class, Decoder, Random, Reason, Session};

/// A station of the line, with windows of `W` frames to at most `TO` others and from at most `FROM`. `M` is the longest body of
/// a frame of a window, `N` the longest frame of all.
///
/// Where there is no room for another peer, the one that has been idle longest is forgotten; should it still send, it opens a
/// new session.
#[derive(Clone, Debug)]
pub struct Station<const TO: usize, const FROM: usize, const W: usize, const M: usize, const N: usize> {
    config: Config,
    random: Random,
    decoder: Decoder<N>,
    arbiter: Arbiter<N>,
    senders: Vec<Link<Sender<W, M>>, TO>,
    receivers: Vec<Link<Receiver<W, M>>, FROM>,
    /// The sender that was served last; they take turns.
    turn: usize,
    /// What the arbiter has in work.
    sending: Sending,
    /// A refusal that belongs to no link.
    refusal: Option<(u8, Reason, Session)>,
    last_heard: Instant,
}

#[derive(Clone, Copy, Debug)]
enum Sending {
    Nothing,
    /// What needs no report: an acknowledgement and the like.
    Answer {
        peer: u8,
        kind: Kind,
    },
    /// [`Station::post`], [`Station::post_frame`].
    Post,
    Window {
        peer: u8,
        what: window::Sending,
    },
}

impl<const TO: usize, const FROM: usize, const W: usize, const M: usize, const N: usize>
    Station<TO, FROM, W, M, N>
{
    const LENGTHS: () = assert!(
        M + frame::TAGGED_OVERHEAD <= N && N <= frame::MAX_FRAME,
        "a frame of a window must fit in the longest frame, and that in the line's longest"
    );

    /// A station that starts now. Its seed must be another than that of any other station, and another at each start.
    pub fn new(config: Config, now: Instant, seed: u64) -> Self {
        const { Self::LENGTHS };
        let mut random = Random::new(seed);
        let arbiter = Arbiter::new(config.arbiter, now, draw(&mut random));
        Self {
            config,
            random,
            decoder: Decoder::new(),
            arbiter,
            senders: Vec::new(),
            receivers: Vec::new(),
            turn: 0,
            sending: Sending::Nothing,
            refusal: None,
            last_heard: now,
        }
    }

    /// Takes a frame for the window to `peer`; `body` is its sections, all for this station.
    ///
    /// # Errors
    /// Any [`Refused`]; `Full` where there is no room for another peer, too.
    pub fn submit(&mut self, now: Instant, peer: u8, class: Class, body: &[u8]) -> Result<Ticket, Refused> {
        if body.len() > M {
            return Err(Refused::TooLong);
        }
        let mut sections = Sections::new(body);
        let all_for_peer = sections.by_ref().all(|section| section.address == peer);
        if body.is_empty() || !all_for_peer || !sections.rest().is_empty() {
            return Err(Refused::Sections);
        }
        let random = &mut self.random;
        let new = || Sender::new(draw(random));
        let sender = links::reserve(&mut self.senders, now, peer, Sender::is_idle, new);
        sender.ok_or(Refused::Full)?.submit(class, body)
    }

    /// Frames to `peer` whose outcome is open.
    pub fn outstanding(&self, peer: u8) -> usize {
        self.senders.iter().find(|link| link.peer == peer).map_or(0, |link| link.end.outstanding())
    }

    /// Takes a byte that the line said, the echo of what is sent too, at its end. [`Station::poll`] until it is idle, before
    /// the next.
    pub fn receive(&mut self, now: Instant, byte: u8) {
        self.settle(now);
        self.last_heard = now;
        self.arbiter.receive(now, byte);
        self.decoder.push(byte);
    }

    /// The line reported a parity, framing or overrun error.
    pub fn line_error(&mut self, now: Instant) {
        self.settle(now);
        self.last_heard = now;
        self.arbiter.line_error(now);
    }

    /// A character is arriving; see [`Arbiter::carrier`].
    pub fn carrier(&mut self, now: Instant) {
        self.arbiter.carrier(now);
    }

    /// Whether there is something to do at once, besides what time brings about: a byte that leaves this false needs no
    /// [`Station::poll`] before the next, if that has come already.
    pub fn is_pressing(&self) -> bool {
        self.decoder.is_ready() || self.arbiter.is_pressing()
    }

    /// What to do now.
    pub fn poll(&mut self, now: Instant) -> Action<'_> {
        self.settle(now);
        while self.decoder.advance() {
            if self.take_frame(now) {
                return self.decoder.frame().map_or(Action::Idle, Action::Heard);
            }
        }
        for link in &mut self.senders {
            link.end.elapse(&self.config.window, now);
        }
        if let Some(at) = self.senders.iter().position(|link| link.end.has_outcome()) {
            return self.done(at);
        }
        if let Some(at) = self.receivers.iter().position(|link| link.end.has_frame()) {
            return self.received(now, at);
        }
        self.fill(now);
        self.arbiter.elapse(now);
        if self.arbiter.is_finished() {
            return self.finish(now);
        }
        match self.arbiter.poll(now) {
            arbiter::Action::Transmit(bytes) => Action::Transmit(bytes),
            arbiter::Action::Jam(bytes) => Action::Jam(bytes),
            arbiter::Action::Done(_) | arbiter::Action::Idle => Action::Idle,
        }
    }

    /// When to poll again, besides after everything that is told to the station.
    pub fn poll_at(&self) -> Option<Instant> {
        let mut at = self.arbiter.poll_at();
        let mut by = |time: Option<Instant>| at = [at, time].into_iter().flatten().min();
        if self.decoder.is_ready() {
            by(Some(Instant::ZERO));
        } else if self.decoder.is_inside() {
            by(Some(self.last_heard + self.config.silence));
        }
        let free = !self.arbiter.is_busy();
        if free && self.refusal.is_some() {
            by(Some(Instant::ZERO));
        }
        for Link { end: sender, .. } in &self.senders {
            by(sender.elapse_at());
            if sender.has_outcome() || (free && sender.next(&self.config.window).is_some()) {
                by(Some(Instant::ZERO));
            }
        }
        for Link { end: receiver, .. } in &self.receivers {
            if receiver.has_frame() {
                by(Some(Instant::ZERO));
            }
            if free {
                by(receiver.next_at());
            }
        }
        at
    }

    /// What the station has met on the line.
    pub const fn statistics(&self) -> Statistics {
        self.arbiter.statistics()
    }

    /// Frames heard whose check did not hold, modulo 2^32.
    pub const fn damaged(&self) -> u32 {
        self.decoder.damaged()
    }

    /// Lets the decoder know that the line has fallen silent.
    fn settle(&mut self, now: Instant) {
        if self.decoder.is_inside() && now >= self.last_heard + self.config.silence {
            self.decoder.silence();
        }
    }

    /// Takes the frame that the decoder has found; true if it is for the caller.
    fn take_frame(&mut self, now: Instant) -> bool {
        let Some(Frame { origin, kind, body }) = self.decoder.frame() else {
            return false;
        };
        let own = self.config.address;
        let for_us = body.first() == Some(&own);
        match kind {
            _ if origin == own || self.is_echo() => false,
            Kind::Plain | Kind::Single(_) | Kind::Receipt { .. } => true,
            Kind::Refusal { session: Session::NONE, .. } => true,
            _ if !for_us => self.config.promiscuous,
            Kind::Opening { sender } => {
                let random = &mut self.random;
                let new = || Receiver::new(draw(random));
                match links::reserve(&mut self.receivers, now, origin, Receiver::is_idle, new) {
                    Some(receiver) => receiver.opened(sender),
                    None => self.refusal = Some((origin, Reason::NoRoom, Session { sender, receiver: 0 })),
                }
                false
            }
            _ => {
                self.take_linked(now);
                false
            }
        }
    }

    /// Whether what was heard is what was posted in another's name.
    fn is_echo(&self) -> bool {
        self.arbiter.is_finished() && self.decoder.frame_bytes() == self.arbiter.frame()
    }

    /// Takes a frame of a window that must exist.
    fn take_linked(&mut self, now: Instant) {
        let Some(Frame { origin, kind, body }) = self.decoder.frame() else {
            return;
        };
        let config = &self.config.window;
        if let Kind::Numbered { number, class, session } = kind {
            match links::find(&mut self.receivers, now, origin) {
                Some(receiver) => receiver.arrived(now, number, class, session, body),
                None => self.refusal = Some((origin, Reason::Session, session)),
            }
        } else if let Some(sender) = links::find(&mut self.senders, now, origin) {
            match kind {
                Kind::Acknowledgement { next, held, session } => {
                    sender.acknowledged(config, now, next, held, session);
                }
                Kind::Consent { session, window } => sender.consented(config, now, session, window),
                Kind::Refusal { reason, session } => sender.refused(reason, session),
                _ => {}
            }
        }
    }

    fn done(&mut self, at: usize) -> Action<'_> {
        let link = self.senders.get_mut(at);
        let done = link.and_then(|link| link.end.outcome().map(|outcome| (link.peer, outcome)));
        done.map_or(Action::Idle, |(to, (ticket, outcome))| Action::Done { to, ticket, outcome })
    }

    fn received(&mut self, now: Instant, at: usize) -> Action<'_> {
        let Some(Link { peer, end: receiver, .. }) = self.receivers.get_mut(at) else {
            return Action::Idle;
        };
        let from = *peer;
        receiver.take(&self.config.window, now).map_or(Action::Idle, |(class, body)| Action::Received {
            from,
            class,
            body,
        })
    }

    /// Gives the arbiter a frame if it has none: answers first, then the windows in turn.
    fn fill(&mut self, now: Instant) {
        if self.is_free() && !self.answer(now) {
            self.fill_from_window(now);
        }
    }

    fn answer(&mut self, now: Instant) -> bool {
        let answer = match self.refusal.take() {
            Some((peer, reason, session)) => Some((peer, Kind::Refusal { reason, session })),
            None => self.receivers.iter_mut().find_map(|Link { peer, end: receiver, .. }| {
                let kind = receiver.next(now)?;
                receiver.sent(kind);
                Some((*peer, kind))
            }),
        };
        let Some((peer, kind)) = answer else {
            return false;
        };
        let body = [peer, 0, section::TERMINATOR];
        let origin = self.config.address;
        let taken =
            self.arbiter.submit(now, Precedence::Ordinary, |buffer| frame::emit(buffer, origin, kind, &body));
        self.sending = Sending::Answer { peer, kind };
        taken.is_ok()
    }

    /// Takes a frame of a window back that is not on the line; it is as if it had not been given to the arbiter.
    fn step_back(&mut self, now: Instant) {
        if self.arbiter.withdraw()
            && let Sending::Answer { peer, kind } = self.sending
            && let Some(receiver) = links::find(&mut self.receivers, now, peer)
        {
            receiver.failed(now, kind);
        }
        self.sending = Sending::Nothing;
    }

    fn fill_from_window(&mut self, now: Instant) {
        let count = self.senders.len();
        for at in (0..count).map(|step| (self.turn + 1 + step) % count) {
            let Some(Link { peer, end: sender, .. }) = self.senders.get(at) else {
                continue;
            };
            let Some((what, kind, body)) = sender.next(&self.config.window) else {
                continue;
            };
            let opening = [*peer, 0, section::TERMINATOR];
            let body = if body.is_empty() { &opening } else { body };
            let origin = self.config.address;
            let _ = self
                .arbiter
                .submit(now, Precedence::Ordinary, |buffer| frame::emit(buffer, origin, kind, body));
            self.sending = Sending::Window { peer: *peer, what };
            self.turn = at;
            return;
        }
    }

    /// The arbiter is done with its frame.
    fn finish(&mut self, now: Instant) -> Action<'_> {
        let arbiter::Action::Done(outcome) = self.arbiter.poll(now) else {
            return Action::Idle;
        };
        match core::mem::replace(&mut self.sending, Sending::Nothing) {
            Sending::Post => return Action::Posted(outcome),
            Sending::Window { peer, what } => {
                if let Some(sender) = links::find(&mut self.senders, now, peer) {
                    sender.sent(&self.config.window, now, what, outcome.is_ok());
                }
            }
            Sending::Answer { peer, kind } if outcome.is_err() => {
                if let Some(receiver) = links::find(&mut self.receivers, now, peer) {
                    receiver.failed(now, kind);
                }
            }
            Sending::Nothing | Sending::Answer { .. } => {}
        }
        Action::Free
    }
}

fn draw(random: &mut Random) -> u64 {
    u64::from(random.next()) << 32 | u64::from(random.next())
}
