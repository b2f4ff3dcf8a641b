//! Homing.

use core::time::Duration;

use puente_line::Instant;

use super::{Controlword, State, Statusword};

/// What the statusword tells of a homing procedure: bits 10, 12 and 13.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// In progress.
    InProgress,
    /// Interrupted, or not started.
    Interrupted,
    /// Home has been found; the drive still moves.
    Attained,
    /// Home has been found, and the drive stands.
    Complete,
    /// An error; the drive still moves.
    ErrorMoving,
    /// An error; the drive stands.
    ErrorStopped,
}

impl Status {
    /// The status that a word tells in this mode. An error and home at once, which is reserved, is an error.
    pub const fn of(word: Statusword) -> Self {
        let reached = word.has(Statusword::TARGET_REACHED);
        match (word.has(Statusword::MODE_13), word.has(Statusword::MODE_12), reached) {
            (false, false, false) => Self::InProgress,
            (false, false, true) => Self::Interrupted,
            (false, true, false) => Self::Attained,
            (false, true, true) => Self::Complete,
            (true, _, false) => Self::ErrorMoving,
            (true, _, true) => Self::ErrorStopped,
        }
    }
}

/// A way to find home (6098h): 1 to 37, those below 0 are the manufacturer's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Method(i8);

impl Method {
    /// The method of a number; `None` for 0 and for those that the standard reserves.
    pub const fn new(number: i8) -> Option<Self> {
        match number {
            i8::MIN..=-1 | 1..=14 | 17..=30 | 33..=35 | 37 => Some(Self(number)),
            _ => None,
        }
    }

    /// Its number.
    pub const fn number(self) -> i8 {
        self.0
    }

    /// Whether home is where the drive stands, so that it does not move.
    pub const fn stands_still(self) -> bool {
        matches!(self.0, 35 | 37)
    }
}

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Nothing has been started.
    Idle,
    /// It goes on.
    Running,
    /// Home has been found, and the drive stands.
    Complete,
    /// An error, and the drive stands.
    Failed,
    /// The drive is not under current any more.
    Lost,
}

/// What to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Advice {
    /// The mode's bits of the controlword.
    pub bits: u16,
    /// How far it is.
    pub progress: Progress,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Idle,
    /// Bit 4 must be 0.
    Low,
    /// Bit 4 is set. What the drive says is `fresh` once it has said something else than that it is over.
    High {
        fresh: bool,
        since: Instant,
    },
    Over(Progress),
}

/// A drive whose home is to be found. Bit 4 of the controlword rises from 0 and stays until the end; that home was found is
/// believed only if the drive has said meanwhile that it was not, or, with a method that does not move it, has had time to.
#[derive(Clone, Debug)]
pub struct Homing {
    phase: Phase,
    grace: Duration,
    stands_still: bool,
    /// Bit 4 is set.
    raised: bool,
}

impl Homing {
    /// `grace`: how long a drive may take to forget that it had found home; 500 ms are plenty.
    pub const fn new(grace: Duration) -> Self {
        Self { phase: Phase::Idle, grace, stands_still: false, raised: false }
    }

    /// Begins. The drive must have this method, be in the mode, and under current.
    pub const fn start(&mut self, method: Method) {
        self.stands_still = method.stands_still();
        self.phase = Phase::Low;
    }

    /// Ends it: bit 4 falls, and the drive stops.
    pub const fn cancel(&mut self) {
        self.phase = Phase::Idle;
    }

    /// What to do about a drive that says `status`. The advice has been carried out when this is called next.
    pub fn advise(&mut self, now: Instant, status: Statusword) -> Advice {
        let told = Status::of(status);
        let busy = matches!(self.phase, Phase::Low | Phase::High { .. });
        if busy && status.state() != Some(State::OperationEnabled) {
            self.phase = Phase::Over(Progress::Lost);
        }
        match &mut self.phase {
            Phase::Low if !self.raised => self.phase = Phase::High { fresh: false, since: now },
            Phase::High { fresh, since } => {
                let over = matches!(told, Status::Complete | Status::ErrorMoving | Status::ErrorStopped);
                *fresh |= !over || (self.stands_still && now.since(*since) >= self.grace);
                if *fresh {
                    self.phase = match told {
                        Status::Complete => Phase::Over(Progress::Complete),
                        Status::ErrorStopped => Phase::Over(Progress::Failed),
                        _ => self.phase,
                    };
                }
            }
            Phase::Idle | Phase::Low | Phase::Over(_) => {}
        }
        let progress = match self.phase {
            Phase::Idle => Progress::Idle,
            Phase::Low | Phase::High { .. } => Progress::Running,
            Phase::Over(progress) => progress,
        };
        self.raised = matches!(self.phase, Phase::High { .. });
        Advice { bits: if self.raised { Controlword::MODE_4 } else { 0 }, progress }
    }
}
