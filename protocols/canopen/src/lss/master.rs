//! The LSS master.

use core::fmt;
use core::time::Duration;

use puente_line::Instant;

use super::fastscan::{Fastscan, Known};
use super::{Identity, Mode, Part, Request, Response};
use crate::Frame;

/// What a master is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Switches all nodes.
    SwitchGlobal(Mode),
    /// Switches the node of this identity into configuration.
    Select(Identity),
    /// Gives the node in configuration a node-ID, 1 to 127, or 255 to take it away.
    ConfigureNodeId(u8),
    /// Gives the nodes in configuration a bit rate.
    ConfigureBitTiming {
        /// 0 is that of the standard.
        table: u8,
        /// Index in it.
        index: u8,
    },
    /// Lets the nodes in configuration use it.
    ActivateBitTiming {
        /// Twice so long nobody sends: before and after the switch. ms.
        delay: u16,
    },
    /// Lets the node in configuration keep what it has been given.
    Store,
    /// Asks the node in configuration who it is.
    Inquire(Part),
    /// Asks it for its node-ID.
    InquireNodeId,
    /// Finds a node that has no node-ID, and puts it into configuration. Takes up to 133 times the time-out, for each question
    /// is left all of it: several nodes may answer.
    Fastscan(Known),
}

/// How it ended well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Sent, or confirmed where it is confirmed.
    Done,
    /// What was asked for: a part of an identity.
    Part(u32),
    /// What was asked for: a node-ID, 255 for none.
    NodeId(u8),
    /// Who was found.
    Identity(Identity),
}

/// How it ended otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// No answer in time.
    Timeout,
    /// The node does not do it.
    Refused {
        /// Why: 255: see `vendor`; node-ID 1: out of range; bit timing 1: not supported; store 1: not supported, 2: no access to
        /// its medium.
        error: u8,
        /// The manufacturer's error code.
        vendor: u8,
    },
    /// There is no node without node-ID.
    Nobody,
    /// There was one, and then it was not the one that was found; or it is not the one that is known.
    Vanished,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Timeout => f.write_str("no node answered"),
            Self::Refused { error: 255, vendor } => {
                write!(f, "the node refused, error {vendor} of its vendor")
            }
            Self::Refused { error, .. } => write!(f, "the node refused, error {error}"),
            Self::Nobody => f.write_str("all nodes have a node-ID"),
            Self::Vanished => f.write_str("the node that answered is another"),
        }
    }
}

impl core::error::Error for Failure {}

/// The outcome of the last command has not been fetched yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy;

impl fmt::Display for Busy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the LSS master has a command in work")
    }
}

impl core::error::Error for Busy {}

/// What the caller has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Send this frame.
    Transmit(Frame),
    /// The command is done.
    Done(Result<Outcome, Failure>),
    /// Nothing until the next frame or the time of [`Master::poll_at`].
    Idle,
}

#[derive(Clone, Copy, Debug)]
enum State {
    Idle,
    /// To be sent.
    Ready(Work),
    /// An answer is due.
    Waiting {
        work: Work,
        answered: bool,
        until: Instant,
    },
    /// The outcome has not been fetched.
    Finished(Result<Outcome, Failure>),
}

#[derive(Clone, Copy, Debug)]
enum Work {
    /// One request.
    Single(Request),
    /// The next of the four messages that select a node.
    Select(Identity, Part),
    Scan(Fastscan),
}

/// The master of layer setting services: one command at a time. Nodes answer without saying who they are, so that only one
/// may be in configuration when it is asked.
#[derive(Clone, Debug)]
pub struct Master {
    timeout: Duration,
    state: State,
}

impl Master {
    /// One that waits so long for an answer; 100 ms are usual.
    pub const fn new(timeout: Duration) -> Self {
        Self { timeout, state: State::Idle }
    }

    /// Changes how long it waits for an answer, from the next message on.
    pub const fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// Takes a command.
    ///
    /// # Errors
    /// `Busy` until the outcome of the last one has been fetched.
    pub const fn submit(&mut self, command: Command) -> Result<(), Busy> {
        let State::Idle = self.state else {
            return Err(Busy);
        };
        self.state = State::Ready(match command {
            Command::SwitchGlobal(mode) => Work::Single(Request::SwitchGlobal(mode)),
            Command::Select(identity) => Work::Select(identity, Part::Vendor),
            Command::ConfigureNodeId(id) => Work::Single(Request::ConfigureNodeId(id)),
            Command::ConfigureBitTiming { table, index } => {
                Work::Single(Request::ConfigureBitTiming { table, index })
            }
            Command::ActivateBitTiming { delay } => Work::Single(Request::ActivateBitTiming { delay }),
            Command::Store => Work::Single(Request::Store),
            Command::Inquire(part) => Work::Single(Request::Inquire(part)),
            Command::InquireNodeId => Work::Single(Request::InquireNodeId),
            Command::Fastscan(known) => Work::Scan(Fastscan::new(known)),
        });
        Ok(())
    }

    /// The command in work, if there is one, ends as if nobody had answered.
    pub const fn abandon(&mut self) {
        if let State::Ready(_) | State::Waiting { .. } = self.state {
            self.state = State::Finished(Err(Failure::Timeout));
        }
    }

    /// Takes a frame of the bus.
    pub fn receive(&mut self, now: Instant, frame: &Frame) {
        self.elapse(now);
        let (Some(response), State::Waiting { work, answered, .. }) =
            (Response::parse(frame), &mut self.state)
        else {
            return;
        };
        let end = match (work, response) {
            (Work::Scan(_), Response::Identified) => {
                *answered = true;
                return;
            }
            (Work::Select(..), Response::Selected) => Ok(Outcome::Done),
            (Work::Single(request), Response::Configured { what, error, vendor })
                if matches!(
                    (*request, what),
                    (Request::ConfigureNodeId(_), 0x11)
                        | (Request::ConfigureBitTiming { .. }, 0x13)
                        | (Request::Store, 0x17)
                ) =>
            {
                if error == 0 {
                    Ok(Outcome::Done)
                } else {
                    Err(Failure::Refused { error, vendor })
                }
            }
            (Work::Single(Request::Inquire(asked)), Response::Part(part, value)) if *asked == part => {
                Ok(Outcome::Part(value))
            }
            (Work::Single(Request::InquireNodeId), Response::NodeId(id)) => Ok(Outcome::NodeId(id)),
            _ => return,
        };
        self.state = State::Finished(end);
    }

    /// The outcome alone: see [`Master::poll`].
    pub fn outcome(&mut self, now: Instant) -> Option<Result<Outcome, Failure>> {
        self.elapse(now);
        let State::Finished(end) = self.state else {
            return None;
        };
        self.state = State::Idle;
        Some(end)
    }

    /// What to do now.
    pub fn poll(&mut self, now: Instant) -> Action {
        if let Some(end) = self.outcome(now) {
            return Action::Done(end);
        }
        match self.state {
            State::Ready(work) => Action::Transmit(self.send(now, work).frame()),
            State::Idle | State::Waiting { .. } | State::Finished(_) => Action::Idle,
        }
    }

    /// When to poll again, besides after `submit` and `receive`.
    pub const fn poll_at(&self) -> Option<Instant> {
        match self.state {
            State::Idle => None,
            State::Ready(_) | State::Finished(_) => Some(Instant::ZERO),
            State::Waiting { until, .. } => Some(until),
        }
    }

    fn send(&mut self, now: Instant, work: Work) -> Request {
        let waiting = State::Waiting { work, answered: false, until: now + self.timeout };
        let (request, next) = match work {
            Work::Single(request @ (Request::SwitchGlobal(_) | Request::ActivateBitTiming { .. })) => {
                (request, State::Finished(Ok(Outcome::Done)))
            }
            Work::Single(request) => (request, waiting),
            Work::Select(identity, part) => {
                let next = match Part::from_number(part as u8 + 1) {
                    Some(next) => State::Ready(Work::Select(identity, next)),
                    None => waiting,
                };
                (Request::Select(part, identity.part(part)), next)
            }
            Work::Scan(scan) => (scan.question(), waiting),
        };
        self.state = next;
        request
    }

    fn elapse(&mut self, now: Instant) {
        let State::Waiting { work, answered, until } = self.state else {
            return;
        };
        if now < until {
            return;
        }
        self.state = match work {
            Work::Scan(mut scan) => match scan.heard(answered) {
                None => State::Ready(Work::Scan(scan)),
                Some(end) => State::Finished(end.map(Outcome::Identity)),
            },
            Work::Single(_) | Work::Select(..) => State::Finished(Err(Failure::Timeout)),
        };
    }
}
