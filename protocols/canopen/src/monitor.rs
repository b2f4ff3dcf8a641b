//! Whether a node is there: heartbeat consumer and node guarding master (7.2.8.3.2).

use core::fmt;
use core::time::Duration;

use heapless::Deque;
use puente_line::Instant;

use crate::cob::NodeId;
use crate::cycle::Cycle;
use crate::frame::Frame;
use crate::nmt::{Sign, State};

/// How a node is watched. A node has one of both at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Supervision {
    /// Not at all; its signs are taken note of.
    Off,
    /// It sends heartbeats (7.2.8.3.2.2). Counts from the first one on.
    Heartbeat {
        /// Consumer heartbeat time: it is lost when no heartbeat comes for so long. Above its producer time (1017h).
        timeout: Duration,
    },
    /// It is asked, and answers with a bit that toggles (7.2.8.3.2.1).
    Guarding {
        /// Guard time (100Ch): it is asked so often.
        time: Duration,
        /// Life time factor (100Dh), at least 1, better 2: after so many guard times without an answer it is lost.
        factor: u8,
    },
}

/// What became of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// It has booted: its communication objects are as after power-on, and it is pre-operational.
    BootUp,
    /// Its first sign since its boot-up or since it has been watched.
    Started(State),
    /// It has changed its state.
    Changed {
        /// What it was.
        from: State,
        /// What it is.
        to: State,
    },
    /// No sign in time.
    Lost(Supervision),
    /// It is back, without a boot-up.
    Resumed(State),
    /// Its answer repeats the toggle bit of the one before, and does not count (7.2.8.3.2.1).
    Toggle,
}

/// What the caller has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Send this frame.
    Transmit(Frame),
    /// Something happened to the node.
    Event(Event),
    /// Nothing until the next frame or the time of [`Monitor::poll_at`].
    Idle,
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BootUp => f.write_str("booted"),
            Self::Started(state) => write!(f, "present, {state}"),
            Self::Changed { from, to } => write!(f, "{to}, was {from}"),
            Self::Lost(Supervision::Guarding { .. }) => f.write_str("lost: no answer to guarding"),
            Self::Lost(_) => f.write_str("lost: no heartbeat"),
            Self::Resumed(state) => write!(f, "back, {state}"),
            Self::Toggle => f.write_str("answers guarding with the same toggle bit twice"),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// No sign yet, and none missed.
    Silent,
    /// The last sign counts until then.
    Alive {
        until: Option<Instant>,
    },
    Lost,
}

/// An [`Event`] that is to be told, in fewer bytes.
#[derive(Clone, Copy, Debug)]
enum Note {
    BootUp,
    Started(State),
    Changed { from: State, to: State },
    Lost,
    Resumed(State),
    Toggle,
}

/// Watches one node.
#[derive(Clone, Debug)]
pub struct Monitor {
    node: NodeId,
    supervision: Supervision,
    phase: Phase,
    state: Option<State>,
    requests: Cycle,
    /// The toggle bit that the next answer must have; any while it is not known.
    toggle: Option<bool>,
    /// What a frame and a time-out bring about before the next poll; more than that does not come together.
    events: Deque<Note, 4>,
}

impl Monitor {
    /// Watches `node` from now on. Guarding asks at once.
    pub fn new(node: NodeId, supervision: Supervision, now: Instant) -> Self {
        let time = match supervision {
            Supervision::Guarding { time, .. } => time,
            Supervision::Off | Supervision::Heartbeat { .. } => Duration::ZERO,
        };
        let mut monitor = Self {
            node,
            supervision,
            phase: Phase::Silent,
            state: None,
            requests: Cycle::new(time),
            toggle: None,
            events: Deque::new(),
        };
        if !time.is_zero() {
            monitor.requests.start(now);
            monitor.phase = Phase::Alive { until: monitor.patience(now) };
        }
        monitor
    }

    /// The node's state as far as it is known: not before its first sign, and not while it is lost.
    pub fn state(&self) -> Option<State> {
        self.state.filter(|_| self.phase != Phase::Lost)
    }

    /// Whether it is lost.
    pub fn is_lost(&self) -> bool {
        self.phase == Phase::Lost
    }

    /// From now on the node is watched like this, and its next sign is due in time. Guarding asks at once.
    pub fn watch(&mut self, now: Instant, supervision: Supervision) {
        let mut monitor = Self::new(self.node, supervision, now);
        monitor.phase = Phase::Alive { until: monitor.patience(now) };
        monitor.state = self.state();
        monitor.events = core::mem::take(&mut self.events);
        *self = monitor;
    }

    /// Nothing is known of the node any more, and it is not watched: it was told to reset.
    pub fn forget(&mut self, now: Instant) {
        self.watch(now, Supervision::Off);
        self.state = None;
    }

    /// Whether it is guarded.
    pub const fn is_guarding(&self) -> bool {
        matches!(self.supervision, Supervision::Guarding { .. })
    }

    /// Takes a frame of the bus.
    pub fn receive(&mut self, now: Instant, frame: &Frame) {
        let Some(sign) = Sign::parse(frame).filter(|sign| sign.node == self.node) else {
            return;
        };
        self.elapse(now);
        if sign.state == State::BootUp {
            if !sign.toggle {
                self.boot(now);
            }
            return;
        }
        match self.supervision {
            Supervision::Guarding { .. } => {
                if self.toggle.is_some_and(|expected| expected != sign.toggle) {
                    return self.tell(Note::Toggle);
                }
                self.toggle = Some(!sign.toggle);
            }
            // Not a heartbeat: somebody else guards the node.
            Supervision::Heartbeat { .. } if sign.toggle => return,
            Supervision::Heartbeat { .. } | Supervision::Off => {}
        }
        let event = match (self.phase, self.state) {
            (Phase::Lost, _) => Some(Note::Resumed(sign.state)),
            (_, None) => Some(Note::Started(sign.state)),
            (_, Some(from)) if from != sign.state => Some(Note::Changed { from, to: sign.state }),
            _ => None,
        };
        self.state = Some(sign.state);
        self.phase = Phase::Alive { until: self.patience(now) };
        if let Some(event) = event {
            self.tell(event);
        }
    }

    /// What to do now.
    pub fn poll(&mut self, now: Instant) -> Action {
        match self.event(now) {
            Some(event) => Action::Event(event),
            None => self.request(now).map_or(Action::Idle, Action::Transmit),
        }
    }

    /// The next event alone: see [`Monitor::poll`].
    pub fn event(&mut self, now: Instant) -> Option<Event> {
        self.elapse(now);
        Some(match self.events.pop_front()? {
            Note::BootUp => Event::BootUp,
            Note::Started(state) => Event::Started(state),
            Note::Changed { from, to } => Event::Changed { from, to },
            Note::Lost => Event::Lost(self.supervision),
            Note::Resumed(state) => Event::Resumed(state),
            Note::Toggle => Event::Toggle,
        })
    }

    /// The question of guarding that is due.
    pub fn request(&mut self, now: Instant) -> Option<Frame> {
        self.requests.take(now).map(|_| Sign::request(self.node))
    }

    /// When to poll again, besides after `receive`.
    pub fn poll_at(&self) -> Option<Instant> {
        if !self.events.is_empty() {
            return Some(Instant::ZERO);
        }
        let until = match self.phase {
            Phase::Alive { until } => until,
            Phase::Silent | Phase::Lost => None,
        };
        match (until, self.requests.due()) {
            (Some(until), Some(due)) => Some(until.min(due)),
            (until, due) => until.or(due),
        }
    }

    /// Until when a sign of now counts.
    fn patience(&self, now: Instant) -> Option<Instant> {
        match self.supervision {
            Supervision::Off => None,
            Supervision::Heartbeat { timeout } => Some(now + timeout),
            Supervision::Guarding { time, factor } => {
                Some(now + time.saturating_mul(u32::from(factor.max(1))))
            }
        }
    }

    /// A sign that comes at the very end is too late.
    fn elapse(&mut self, now: Instant) {
        if let Phase::Alive { until: Some(until) } = self.phase
            && now >= until
        {
            self.phase = Phase::Lost;
            self.toggle = None;
            self.tell(Note::Lost);
        }
    }

    fn boot(&mut self, now: Instant) {
        // The first answer after a reset of the communication has the toggle bit 0.
        self.toggle = Some(false);
        self.state = None;
        self.phase = match self.supervision {
            // Its heartbeat begins when it has been configured, which may take a while.
            Supervision::Off | Supervision::Heartbeat { .. } => Phase::Silent,
            Supervision::Guarding { .. } => Phase::Alive { until: self.patience(now) },
        };
        self.tell(Note::BootUp);
    }

    fn tell(&mut self, event: Note) {
        if self.events.is_full() {
            // Whoever does not poll learns the latest.
            let _ = self.events.pop_back();
        }
        let _ = self.events.push_back(event);
    }
}
