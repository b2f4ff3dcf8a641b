//! The module's end: what the bus says goes to the loop, by the rules of the [crate], and what it is asked comes back.

mod authority;
mod types;

use core::time::Duration;

use puente_drives::pid::Event;
use puente_framed::arbiter::{Precedence, Statistics};
use puente_framed::window::{Cause, Outcome, Refused, Ticket};
use puente_framed::{Class, Frame, Kind, Reason, Station, frame, section, station};
use puente_line::Instant;

use crate::turns::{self, Turns};
use crate::{Form, Refusal, Report, Setting, event};
use authority::Authority;
pub use types::{Action, Config, Loop};

/// A module's station, with windows of `W` events to at most `PEERS` commanders; `N` is the longest frame that it takes.
///
/// The loop may run elsewhere, as in an interrupt: see [`Loop`]. What it tells goes to [`Node::event`].
#[derive(Clone, Debug)]
pub struct Node<const PEERS: usize, const W: usize, const N: usize> {
    address: u8,
    form: Form,
    station: Station<PEERS, 0, W, { event::BODY }, N>,
    authority: Authority,
    turns: Turns,
    answer: Option<Answer>,
    /// What the commander has not been told yet.
    event: Option<(u8, Event)>,
    /// When to tell it, if not at once.
    again_at: Option<Instant>,
    /// How long until then.
    pause: Duration,
    /// What he has been told last.
    last: Option<(Ticket, u8, Event)>,
}

/// What was asked.
#[derive(Clone, Copy, Debug)]
struct Answer {
    to: u8,
    /// Its turn.
    at: Instant,
    what: What,
}

#[derive(Clone, Copy, Debug)]
enum What {
    Report(Option<Refusal>),
    /// A frame of the thesis was understood, or not.
    Thesis(Kind),
}

impl<const PEERS: usize, const W: usize, const N: usize> Node<PEERS, W, N> {
    /// A module that nobody commands. Its seed must be another than that of any other station, and another at each start.
    pub fn new(config: Config, now: Instant, seed: u64) -> Self {
        Self {
            address: config.station.address,
            form: config.form,
            station: Station::new(config.station, now, seed),
            authority: Authority::new(),
            turns: Turns::new(&config.station.arbiter),
            answer: None,
            event: None,
            again_at: None,
            pause: config.station.window.min_timeout,
            last: None,
        }
    }

    /// The loop tells something. Of two that the commander has not been told yet, the newer counts.
    pub fn event(&mut self, event: Event) {
        self.event = self.authority.commander().map(|commander| (commander, event)).or(self.event);
    }

    /// Takes a byte that the line said, the echo of what is sent too, at its end. [`Node::poll`] until it is idle, before the
    /// next.
    pub fn receive(&mut self, now: Instant, byte: u8) {
        self.station.receive(now, byte);
    }

    /// The line reported a parity, framing or overrun error.
    pub fn line_error(&mut self, now: Instant) {
        self.station.line_error(now);
    }

    /// A character is arriving; see [`puente_framed::Arbiter::carrier`].
    pub fn carrier(&mut self, now: Instant) {
        self.station.carrier(now);
    }

    /// Whether there is something to do at once; see [`Station::is_pressing`].
    pub fn is_pressing(&self) -> bool {
        self.station.is_pressing()
    }

    /// What to do now. The loop is told and asked in here.
    pub fn poll(&mut self, now: Instant, servo: &mut impl Loop) -> Action<'_> {
        loop {
            self.give_answer(now, servo);
            self.give_event(now);
            match self.station.poll(now) {
                station::Action::Transmit(_) => return Action::Transmit(self.station.sent()),
                station::Action::Jam(bytes) => return Action::Jam(bytes),
                // A collision that is over may just have let the answer in.
                station::Action::Idle => {
                    if self.answers(now) {
                        continue;
                    }
                    return Action::Idle;
                }
                station::Action::Done { ticket, outcome, .. } => self.told(now, ticket, outcome),
                station::Action::Heard(frame) => {
                    let place = (self.address, self.form, self.turns);
                    if let Some(answer) = take(&mut self.authority, place, now, frame, servo) {
                        // Whoever asks again does not wait for the last answer any more.
                        self.station.withdraw();
                        self.answer = Some(answer);
                    }
                }
                _ => {}
            }
        }
    }

    /// When to poll again, besides after everything that is told to the node.
    pub fn poll_at(&self) -> Option<Instant> {
        let answer = self.answer.filter(|_| self.station.can_answer()).map(|answer| answer.at);
        [self.station.poll_at(), answer, self.again_at].into_iter().flatten().min()
    }

    /// Who commands, or was the last to, while the module was under current.
    pub fn commander(&self) -> Option<u8> {
        self.authority.commander()
    }

    /// What the station has met on the line.
    pub const fn statistics(&self) -> Statistics {
        self.station.statistics()
    }

    /// Whether the turn of the answer has come.
    fn answers(&self, now: Instant) -> bool {
        self.answer.is_some_and(|answer| answer.at <= now) && self.station.can_answer()
    }

    /// Puts the answer onto the line when its turn has come.
    fn give_answer(&mut self, now: Instant, servo: &impl Loop) {
        let answers = self.answers(now);
        let Some(Answer { to, what, .. }) = self.answer.take_if(|_| answers) else {
            return;
        };
        // Nothing is in work, and it fits.
        let _ = match what {
            What::Report(refused) => {
                let data = Report::new(servo.status(), refused).emit();
                self.station.post_with(now, Precedence::Answer, Kind::Single(Class::Status), |body| {
                    Ok(section::push(body, to, &data)?)
                })
            }
            What::Thesis(kind) => self
                .station
                .post_with(now, Precedence::Answer, kind, |body| Ok(section::push(body, to, &[])?)),
        };
    }

    fn give_event(&mut self, now: Instant) {
        let Some((to, what)) = self.event.filter(|_| self.again_at.is_none_or(|at| at <= now)) else {
            return;
        };
        self.again_at = None;
        let [code] = event::emit(what);
        let body = [to, 1, code, section::TERMINATOR];
        match self.station.submit(now, to, Class::Event, &body) {
            // All places are taken: he does not answer, but he may later.
            Err(Refused::Full) => return,
            Err(_) => {}
            Ok(ticket) => self.last = Some((ticket, to, what)),
        }
        self.event = None;
    }

    /// What has become of an event. A commander that has started anew, or had no room, is told the last one again.
    fn told(&mut self, now: Instant, ticket: Ticket, outcome: Outcome) {
        let Some((_, to, what)) = self.last.take_if(|(last, ..)| *last == ticket) else {
            return;
        };
        let cause = match outcome {
            Outcome::Confirmed => return,
            Outcome::Unconfirmed(cause) | Outcome::NotSent(cause) => cause,
        };
        if matches!(cause, Cause::Restarted | Cause::NoRoom) && self.event.is_none() {
            self.event = Some((to, what));
            self.again_at = Some(now + self.pause);
        }
    }
}

/// Does what a frame says to the module, and gives what is to be answered.
fn take(
    authority: &mut Authority,
    (address, form, turns): (u8, Form, Turns),
    now: Instant,
    frame: Frame<'_>,
    servo: &mut impl Loop,
) -> Option<Answer> {
    let to = frame.origin;
    let data = frame.section_for(address)?.data;
    let setting = Setting::parse(form, data).ok();
    match frame.kind {
        Kind::Single(Class::Data) => {
            let refused = authority.obey(now, to, setting, servo);
            let turn = turns::turn(&frame, address, turns::asks)?;
            Some(Answer { to, at: turns.report_at(now, turn), what: What::Report(refused) })
        }
        Kind::Plain => {
            let refused = authority.set(now, to, setting, servo);
            let kind = match refused {
                None => Kind::Receipt { lrc: frame::lrc(frame.body) },
                Some(_) => {
                    Kind::Refusal { reason: Reason::Meaningless, session: puente_framed::Session::NONE }
                }
            };
            let turn = turns::turn(&frame, address, |_| true)?;
            Some(Answer { to, at: turns.receipt_at(now, turn), what: What::Thesis(kind) })
        }
        _ => None,
    }
}
