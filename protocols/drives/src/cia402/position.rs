//! Profile position: how a set-point is handed over.

use super::{Controlword, State, Statusword};

/// A set-point of profile position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SetPoint {
    /// Where to go, position units.
    pub target: i32,
    /// From where it was to go last, not from zero.
    pub relative: bool,
    /// At once; otherwise after the last set-point has been reached.
    pub immediately: bool,
    /// Without a stop at the last set-point.
    pub blended: bool,
}

impl SetPoint {
    /// To a position, at once.
    pub const fn absolute(target: i32) -> Self {
        Self { target, relative: false, immediately: true, blended: false }
    }

    const fn bits(self) -> u16 {
        let mut bits = 0;
        if self.relative {
            bits |= Controlword::RELATIVE;
        }
        if self.immediately {
            bits |= Controlword::IMMEDIATELY;
        }
        if self.blended {
            bits |= Controlword::ON_SET_POINT;
        }
        bits
    }
}

/// How far a set-point is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is none.
    Idle,
    /// The drive has still to take it.
    Offered,
    /// Taken: the drive is on its way.
    Moving,
    /// The drive says that it is there.
    Reached,
    /// A following error.
    FollowingError,
    /// The drive is not under current any more.
    Lost,
}

/// What to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Advice {
    /// The mode's bits of the controlword.
    pub bits: u16,
    /// The target position that the drive must have *before* it gets these bits.
    pub target: Option<i32>,
    /// How far the set-point is.
    pub progress: Progress,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Idle,
    /// Bit 4 must be 0, and the acknowledgement of the last set-point gone.
    Clear,
    /// Bit 4 is set, the acknowledgement due.
    Offer,
    /// Acknowledged; bit 4 is 0 again.
    Moving,
    Reached,
    Failed(Progress),
}

/// Hands set-points over: bit 4 of the controlword rises only after the acknowledgement of the last set-point has gone, and
/// falls only after the new one's has come; that the target is reached counts only after that one has gone again, for some
/// drives acknowledge before they forget that they had reached the last one.
#[derive(Clone, Debug)]
pub struct Handshake {
    phase: Phase,
    set_point: SetPoint,
    /// Bit 4 is set.
    raised: bool,
}

impl Default for Handshake {
    fn default() -> Self {
        Self::new()
    }
}

impl Handshake {
    /// No set-point.
    pub const fn new() -> Self {
        Self { phase: Phase::Idle, set_point: SetPoint::absolute(0), raised: false }
    }

    /// A set-point, in place of one that has not been taken yet.
    pub const fn submit(&mut self, set_point: SetPoint) {
        self.set_point = set_point;
        self.phase = Phase::Clear;
    }

    /// No set-point any more. One that has been taken goes on: a halt or a quick stop ends it.
    pub const fn clear(&mut self) {
        self.phase = Phase::Idle;
    }

    /// Whether the drive can be given another set-point now; one that counts after the last waits for this.
    pub const fn is_free(&self) -> bool {
        !matches!(self.phase, Phase::Clear | Phase::Offer)
    }

    /// What to do about a drive that says `status`. The advice has been carried out when this is called next.
    pub fn advise(&mut self, status: Statusword) -> Advice {
        let acknowledged = status.has(Statusword::MODE_12);
        let busy = !matches!(self.phase, Phase::Idle | Phase::Reached | Phase::Failed(_));
        if busy && status.state() != Some(State::OperationEnabled) {
            self.phase = Phase::Failed(Progress::Lost);
        }
        self.phase = match self.phase {
            Phase::Clear if !acknowledged && !self.raised => Phase::Offer,
            Phase::Offer if acknowledged => Phase::Moving,
            other => other,
        };
        if self.phase == Phase::Moving {
            if status.has(Statusword::MODE_13) {
                self.phase = Phase::Failed(Progress::FollowingError);
            } else if status.has(Statusword::TARGET_REACHED) && !acknowledged {
                self.phase = Phase::Reached;
            }
        }
        let (bits, target, progress) = match self.phase {
            Phase::Idle => (0, None, Progress::Idle),
            Phase::Clear => (0, None, Progress::Offered),
            Phase::Offer => {
                (self.set_point.bits() | Controlword::MODE_4, Some(self.set_point.target), Progress::Offered)
            }
            Phase::Moving => (0, None, Progress::Moving),
            Phase::Reached => (0, None, Progress::Reached),
            Phase::Failed(progress) => (0, None, progress),
        };
        self.raised = bits & Controlword::MODE_4 != 0;
        Advice { bits, target, progress }
    }
}
