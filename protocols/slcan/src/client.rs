//! The end that has no CAN itself: it opens an adapter, gives it frames no faster than it takes them, and looks after it.

use heapless::Deque;
use puente_canopen::Frame;
use puente_line::{Duration, Instant};

use crate::command::Command;
use crate::lines::{Lines, Text};
use crate::rate::Rate;
use crate::reply::{BusState, Flags, Reply};

/// Frames that an adapter may have without having said that it took them.
pub const WINDOW: usize = 8;
/// How long what an adapter still has to say from before is let pass.
const CLEAR: Duration = Duration::from_millis(100);
/// How long it may take to answer.
const ANSWER: Duration = Duration::from_millis(250);
/// The same once it is open: an adapter may be busy with its bus.
const PATIENCE: Duration = Duration::from_millis(1000);
/// How often the flags are asked for.
const FLAGS: Duration = Duration::from_millis(500);
/// How long an adapter is left alone that has no room for a frame.
const FULL: Duration = Duration::from_millis(5);
/// It may have no room so often, one time after the other, before it is opened anew: 1 s.
const ATTEMPTS: u16 = 200;
/// How long after an opening that failed, or after bus-off, the next one begins.
const REST: Duration = Duration::from_millis(1000);

/// What is wanted of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// The bit rate of the bus.
    pub rate: Rate,
}

/// How the adapter says that it has taken a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// It answers every command.
    Answered,
    /// It says nothing (CANable). Frames are sent no faster than the bus can take them, by their lengths and those of the
    /// frames heard.
    Silent,
}

/// What the adapter has to be told.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// This line.
    Transmit(Text),
    /// Nothing until [`Client::poll_at`].
    Idle,
}

/// What follows from the adapter's bytes, or from its silence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame that was on the bus; one may come just before it is known that the channel is open.
    Heard(Frame),
    /// The channel is open.
    Opened(Flow),
    /// The channel is not open any more, or could not be opened; it is tried again. Frames under way are lost.
    Closed,
    /// What the adapter said of its bus.
    Flags(Flags),
    /// Its controller is off the bus. The channel is closed, so that nothing old goes out when it is back, and opened again
    /// after a rest.
    Off,
    /// There is room for a frame after one was not taken.
    Room,
}

/// Why a frame is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Busy {
    /// The channel is not open.
    Closed,
    /// The adapter has enough. [`Client::poll_at`] tells when to ask again where nothing is received before.
    Full,
}

/// What has been counted since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Lines that were none of the protocol.
    pub garbled: u32,
    /// Frames that the adapter had no room for at once; they were sent again.
    pub refused: u32,
    /// How often the channel was opened.
    pub opened: u32,
}

/// What is said to open a channel, one after the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Ends what the adapter has of an unfinished line, and closes the channel that another client may have left open.
    Clear,
    Rate,
    Open,
    /// Whether it has flags.
    Flags,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// There is nobody to talk to.
    Off,
    /// The command of this step is to be said.
    Next(Step),
    /// It has been said, and is waited for until then.
    Waiting(Step, Instant),
    Open,
    /// It is to be closed, and opened after a rest.
    Leaving,
    /// The next opening begins then.
    Resting(Instant),
}

/// A command that is to be answered.
#[derive(Clone, Copy, Debug)]
enum Asked {
    Send(Frame),
    /// For another time.
    Again(Frame),
    Flags,
}

/// The client of one adapter.
#[derive(Clone, Debug)]
pub struct Client {
    config: Config,
    state: State,
    lines: Lines,
    /// It has answered while it was opened.
    answers: bool,
    /// It has flags, which are asked for next then.
    flags_at: Option<Instant>,
    /// Taken from the user, and not said yet.
    next: Option<Frame>,
    /// Said and refused, to be said again before anything else.
    again: Deque<Frame, WINDOW>,
    again_at: Instant,
    attempts: u16,
    /// Said and not answered, the oldest first. The answer to that is due then.
    asked: Deque<Asked, { WINDOW + 1 }>,
    due: Instant,
    /// An adapter that says nothing has sent all there is by then.
    sent_by: Instant,
    /// A frame waits for that.
    waits: bool,
    counters: Counters,
}

impl Client {
    /// A client without an adapter.
    pub const fn new(config: Config) -> Self {
        Self {
            config,
            state: State::Off,
            lines: Lines::new(),
            answers: false,
            flags_at: None,
            next: None,
            again: Deque::new(),
            again_at: Instant::ZERO,
            attempts: 0,
            asked: Deque::new(),
            due: Instant::ZERO,
            sent_by: Instant::ZERO,
            waits: false,
            counters: Counters { garbled: 0, refused: 0, opened: 0 },
        }
    }

    /// There is a connection to an adapter now, which is opened.
    pub fn connected(&mut self) {
        self.reset(State::Next(Step::Clear));
        self.lines = Lines::new();
    }

    /// There is none any more. Frames under way are lost.
    pub fn disconnected(&mut self) {
        self.reset(State::Off);
    }

    fn reset(&mut self, state: State) {
        self.state = state;
        self.answers = false;
        self.flags_at = None;
        // That it opens again tells who waited.
        self.waits = false;
        self.discard();
        self.asked.clear();
    }

    /// Whether the channel is open.
    pub fn is_open(&self) -> bool {
        self.state == State::Open
    }

    /// What has been counted since the start.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    /// Takes a frame to send.
    pub fn submit(&mut self, now: Instant, frame: &Frame) -> Result<(), Busy> {
        if !self.is_open() {
            return Err(Busy::Closed);
        }
        self.waits = !self.has_room(now);
        if self.waits {
            return Err(Busy::Full);
        }
        self.next = Some(*frame);
        Ok(())
    }

    /// Whether another frame is taken.
    fn has_room(&self, now: Instant) -> bool {
        let room = if self.answers {
            self.again.is_empty() && self.asked.len() < WINDOW
        } else {
            now >= self.room_at()
        };
        room && self.next.is_none()
    }

    /// Drops the frames that have not been said yet. What the adapter has cannot be called back.
    pub fn discard(&mut self) {
        self.next = None;
        self.again.clear();
        self.attempts = 0;
    }

    /// When an adapter that says nothing has so much less to send that it may have another frame.
    fn room_at(&self) -> Instant {
        let window = self.wire_time(WINDOW as u32 * Frame::worst_bits(true, 8));
        Instant::ZERO + self.sent_by.since(Instant::ZERO).saturating_sub(window)
    }

    fn wire_time(&self, bits: u32) -> Duration {
        Duration::from_micros((u64::from(bits) * 1_000_000).div_ceil(self.config.rate.bits().into()))
    }

    /// Takes a byte of the adapter.
    pub fn receive(&mut self, now: Instant, byte: u8) -> Option<Event> {
        let (end, line) = self.lines.push(byte)?;
        let reply = line.and_then(|line| Reply::parse(end, line).ok());
        if matches!(
            self.state,
            State::Off | State::Leaving | State::Resting(_) | State::Waiting(Step::Clear, _)
        ) {
            return None;
        }
        match (reply, self.state) {
            (None, _) => {
                self.counters.garbled = self.counters.garbled.saturating_add(1);
                None
            }
            (
                Some(Reply::Heard { .. }),
                State::Next(Step::Rate | Step::Open) | State::Waiting(Step::Rate, _),
            ) => None,
            (Some(Reply::Heard { frame, .. }), _) => {
                if self.sent_by > now {
                    self.sent_by += self.wire_time(frame.bits());
                }
                Some(Event::Heard(frame))
            }
            (Some(Reply::State { state, .. }), State::Open) => Some(self.enter(state)),
            (Some(Reply::State { .. }), _) => None,
            (Some(reply), State::Waiting(step, _)) => self.answered(now, step, reply),
            (Some(reply), State::Open) if self.answers => self.settle(now, reply),
            _ => None,
        }
    }

    /// The controller has come to a state.
    fn enter(&mut self, state: BusState) -> Event {
        match state {
            BusState::Active => Event::Flags(Flags(0)),
            BusState::Warning => Event::Flags(Flags(Flags::WARNING)),
            BusState::Passive => Event::Flags(Flags(Flags::WARNING | Flags::PASSIVE)),
            BusState::Off => {
                self.reset(State::Leaving);
                Event::Off
            }
        }
    }

    /// An answer while the channel is being opened.
    fn answered(&mut self, now: Instant, step: Step, reply: Reply) -> Option<Event> {
        match (step, reply) {
            (Step::Rate, Reply::Done) => {
                self.answers = true;
                self.state = State::Next(Step::Open);
                None
            }
            (Step::Open, Reply::Done) => {
                self.answers = true;
                self.state = State::Next(Step::Flags);
                None
            }
            (Step::Flags, Reply::Flags(_)) => {
                self.flags_at = Some(now + FLAGS);
                Some(self.open(now))
            }
            // It has none.
            (Step::Flags, Reply::Refused | Reply::Done) => Some(self.open(now)),
            (Step::Rate | Step::Open, Reply::Refused) => Some(self.close(State::Resting(now + REST))),
            _ => None,
        }
    }

    /// An answer to what has been said longest ago.
    fn settle(&mut self, now: Instant, reply: Reply) -> Option<Event> {
        self.due = now + PATIENCE;
        match (reply, self.asked.pop_front()?) {
            (Reply::Flags(flags), Asked::Flags) => Some(Event::Flags(flags)),
            (Reply::Done | Reply::Taken { .. }, Asked::Send(_) | Asked::Again(_)) => {
                self.attempts = 0;
                None
            }
            (Reply::Refused, asked @ (Asked::Send(frame) | Asked::Again(frame))) => {
                // There is room: those that were said and those to be said again are no more than the window.
                let _ = match asked {
                    Asked::Again(_) => self.again.push_front(frame),
                    _ => self.again.push_back(frame),
                };
                self.again_at = now + FULL;
                self.attempts = self.attempts.saturating_add(1);
                self.counters.refused = self.counters.refused.saturating_add(1);
                (self.attempts > ATTEMPTS).then(|| self.close(State::Next(Step::Clear)))
            }
            // A flag that is refused is a channel that is not open: the adapter has started anew. Anything else is out of
            // step.
            _ => Some(self.close(State::Next(Step::Clear))),
        }
    }

    fn open(&mut self, now: Instant) -> Event {
        self.state = State::Open;
        self.sent_by = now;
        self.counters.opened = self.counters.opened.saturating_add(1);
        Event::Opened(if self.answers { Flow::Answered } else { Flow::Silent })
    }

    fn close(&mut self, state: State) -> Event {
        self.reset(state);
        Event::Closed
    }

    /// What the adapter's silence tells, to be asked before [`Client::poll`] whenever that is.
    pub fn expire(&mut self, now: Instant) -> Option<Event> {
        match self.state {
            State::Waiting(step, until) if now >= until => match step {
                Step::Clear => self.state = State::Next(Step::Rate),
                Step::Rate => self.state = State::Next(Step::Open),
                // What does not answer has no flags to tell either.
                Step::Open | Step::Flags => return Some(self.open(now)),
            },
            State::Resting(until) if now >= until => self.state = State::Next(Step::Clear),
            State::Open if self.answers && !self.asked.is_empty() && now >= self.due => {
                return Some(self.close(State::Next(Step::Clear)));
            }
            State::Open if self.waits && self.has_room(now) => {
                self.waits = false;
                return Some(Event::Room);
            }
            _ => {}
        }
        None
    }

    /// What is to be done next.
    pub fn poll(&mut self, now: Instant) -> Action {
        match self.state {
            State::Next(step) => {
                let patience = if step == Step::Clear { CLEAR } else { ANSWER };
                self.state = State::Waiting(step, now + patience);
                Action::Transmit(match step {
                    Step::Clear => clear(),
                    Step::Rate => Command::Rate(self.config.rate).emit(),
                    Step::Open => Command::Open.emit(),
                    Step::Flags => Command::Flags.emit(),
                })
            }
            State::Open => self.say(now),
            State::Leaving => {
                self.state = State::Resting(now + REST);
                Action::Transmit(clear())
            }
            State::Off | State::Waiting(..) | State::Resting(_) => Action::Idle,
        }
    }

    /// The next command to an open channel.
    fn say(&mut self, now: Instant) -> Action {
        if self.flags_at.is_some_and(|at| now >= at) && !self.asked.is_full() {
            self.flags_at = Some(now + FLAGS);
            return self.ask(now, Asked::Flags);
        }
        let asked = if self.again.is_empty() {
            self.next.take().map(Asked::Send)
        } else if now >= self.again_at && self.asked.is_empty() {
            self.again.pop_front().map(Asked::Again)
        } else {
            None
        };
        asked.map_or(Action::Idle, |asked| self.ask(now, asked))
    }

    fn ask(&mut self, now: Instant, asked: Asked) -> Action {
        if self.answers {
            if self.asked.is_empty() {
                self.due = now + PATIENCE;
            }
            // There is room: the window is one less.
            let _ = self.asked.push_back(asked);
        } else if let Asked::Send(frame) = asked {
            self.sent_by = self.sent_by.max(now) + self.wire_time(frame.bits());
        }
        Action::Transmit(match asked {
            Asked::Send(frame) | Asked::Again(frame) => Command::Send(frame).emit(),
            Asked::Flags => Command::Flags.emit(),
        })
    }

    /// When to be asked again at the latest, where nothing is received before: first [`Client::expire`], then
    /// [`Client::poll`].
    pub fn poll_at(&self) -> Option<Instant> {
        match self.state {
            State::Off => None,
            State::Next(_) | State::Leaving => Some(Instant::ZERO),
            State::Waiting(_, until) | State::Resting(until) => Some(until),
            State::Open => {
                let frame = if !self.again.is_empty() {
                    self.asked.is_empty().then_some(self.again_at)
                } else if self.next.is_some() {
                    Some(Instant::ZERO)
                } else {
                    (self.waits && !self.answers).then(|| self.room_at())
                };
                let due = (!self.asked.is_empty()).then_some(self.due);
                let flags = self.flags_at.filter(|_| !self.asked.is_full());
                [frame, due, flags].into_iter().flatten().min()
            }
        }
    }
}

/// Ends a line that the adapter may have half of, and closes the channel.
fn clear() -> Text {
    let mut text = Text::new();
    // They fit.
    let _ = text.extend_from_slice(b"\r\r\r");
    let _ = text.extend_from_slice(&Command::Close.emit());
    text
}
