//! What goes into a master and comes out of it.

use core::fmt;
use core::time::Duration;

use puente_canopen::boot::Verdict;
use puente_canopen::emcy::Emergency;
use puente_canopen::{Address, Frame, NodeId, manager, nmt, sdo};
use puente_drives::cia402::check::Complaint;
use puente_drives::cia402::homing::Method;
use puente_drives::cia402::{Mode, Profile, State, Statusword};

/// A drive on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Its node.
    pub node: NodeId,
    /// What is particular to it.
    pub profile: &'static Profile,
    /// The mode whose set-points come with every SYNC: receive PDO 4 has that set-point and nothing else. `None`, or a mode
    /// that is not cyclic: the PDOs are as delivered.
    pub cyclic: Option<Mode>,
    /// What its homing is set to when it boots.
    pub homing: Homing,
}

impl Axis {
    /// A drive with its PDOs as delivered, and its homing as it is.
    pub const fn new(node: NodeId, profile: &'static Profile) -> Self {
        let homing = Homing { method: None, fast: None, slow: None };
        Self { node, profile, cyclic: None, homing }
    }

    /// The mode whose set-points come with every SYNC.
    pub fn cyclic(&self) -> Option<Mode> {
        self.cyclic.filter(|mode| mode.is_cyclic())
    }

    /// The same where they are positions: moves are made of them.
    pub fn travels(&self) -> Option<Mode> {
        self.cyclic.filter(|mode| matches!(mode, Mode::InterpolatedPosition | Mode::CyclicPosition))
    }
}

/// How a drive finds home; what is `None` is left as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Homing {
    /// Method (6098h).
    pub method: Option<Method>,
    /// Speed to the switch (6099h:1), velocity units.
    pub fast: Option<u32>,
    /// Speed to the zero (6099h:2), velocity units.
    pub slow: Option<u32>,
}

/// What is wanted of a drive, until something else is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// Nothing is commanded: somebody else may do so.
    #[default]
    Observe,
    /// Without current. What moves is stopped first by the drive's own means (605Ch).
    Off,
    /// A quick stop (605Ah), at once; it stays stopped until something else is wanted.
    Stop,
    /// Out of a fault, and without current.
    Reset {
        /// Another number is another attempt.
        serial: u32,
    },
    /// Under current, and standing.
    Hold,
    /// Under current, and moving.
    Move(Motion),
}

impl Order {
    /// Whether the drive is to be under current.
    pub const fn wants_current(self) -> bool {
        matches!(self, Self::Hold | Self::Move(_))
    }
}

/// How a drive is to move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// To a position, with the drive's own profile. Where the drive's cyclic mode has positions, in that: the set-points of the
    /// way are made here, within what the drive is set to (6081h, 607Fh, 6083h, 6084h).
    Position {
        /// Where, position units.
        target: i32,
        /// How fast (6081h), velocity units; `None`: as set.
        velocity: Option<u32>,
        /// From where it was to go last, or where it stands if it did not get there.
        relative: bool,
        /// Another number is another move.
        serial: u32,
    },
    /// At a velocity, velocity units; with every SYNC, where that is the drive's cyclic mode.
    Velocity(i32),
    /// With a torque, thousandths of the rated one; with every SYNC, where that is the drive's cyclic mode.
    Torque(i16),
    /// To its home.
    Home {
        /// How (6098h); `None`: as set.
        method: Option<Method>,
        /// Another number is another search.
        serial: u32,
    },
    /// The next position of a path, position units: interpolated or cyclic synchronous, whichever the drive's cyclic mode is.
    /// The path is the caller's: what jumps there jumps here.
    Interpolate(i32),
    /// In a mode, and no more: nothing moves by it. So a manufacturer's mode is selected, as the jog of a Lexium 23A, of
    /// which it is not known what else it needs.
    Mode(Mode),
}

/// What a drive is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Report {
    /// Whether it is there.
    pub node: Node,
    /// Its statusword, once it is known.
    pub status: Option<Statusword>,
    /// Its mode as it shows it (6061h); `None` while it is not known, or reserved.
    pub mode: Option<Mode>,
    /// Its position (6064h), position units, once it is known.
    pub position: Option<i32>,
    /// Its velocity (606Ch), velocity units, once it is known.
    pub velocity: Option<i32>,
    /// How far it is with what is wanted.
    pub progress: Progress,
    /// It has found home since it has booted.
    pub homed: bool,
    /// Its last emergency that is not over.
    pub emergency: Option<Emergency>,
    /// Its last error (603Fh), since it is in fault.
    pub fault: Option<u16>,
}

impl Report {
    /// The state that its statusword tells.
    pub fn state(&self) -> Option<State> {
        self.status?.state()
    }
}

/// Whether a drive is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Node {
    /// Not yet.
    #[default]
    Absent,
    /// It is being judged and configured.
    Booting,
    /// It is a drive as its profile says, and takes orders.
    Present,
    /// It shows no sign any more.
    Lost,
    /// Two nodes have its node-ID, until it boots: either would obey, and nobody knows which one reports.
    Duplicate,
    /// It is another node than it is to be, or could not be configured.
    Refused(Verdict),
    /// It is no such drive.
    Unfit(Complaint),
    /// The period of its set-points (60C2h), which it changes at a reset only, is not that of SYNC.
    Period {
        /// That of SYNC.
        expected: Duration,
        /// Its own; `None` where it is none.
        received: Option<Duration>,
    },
    /// Whether it is such a drive could not be read.
    Unread {
        /// What was asked for.
        address: Address,
        /// Why it was not read.
        failure: sdo::Failure,
    },
}

impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Absent => f.write_str("absent"),
            Self::Booting => f.write_str("booting"),
            Self::Present => f.write_str("present"),
            Self::Lost => f.write_str("lost"),
            Self::Duplicate => f.write_str(
                "duplicate: two nodes have its node-ID; give one of them another, then switch both off and on",
            ),
            Self::Refused(verdict) => write!(f, "refused: {verdict}"),
            Self::Unfit(complaint) => write!(f, "refused: {complaint}"),
            Self::Period { expected, received } => {
                write!(f, "refused: its interpolation period is {received:?}, that of SYNC {expected:?}")
            }
            Self::Unread { address, failure } => write!(f, "refused: {address}: {failure}"),
        }
    }
}

/// How far a drive is with what is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Progress {
    /// Nothing is wanted.
    #[default]
    Idle,
    /// On its way.
    Running,
    /// There. A velocity or torque is there when the drive says so; a set-point of a path when it follows.
    Reached,
    /// It will not get there; what is wanted stays wanted.
    Failed(Failure),
}

/// Why a drive does not do what is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// It is in fault; its last error (603Fh), where it is known.
    Fault(Option<u16>),
    /// It is not in remote control: its controlword does not count.
    Local,
    /// It does not leave this state.
    Stuck(State),
    /// It has not this mode, or not as its cyclic one.
    NoMode(Mode),
    /// There is no SYNC to move with.
    NoSync,
    /// It does not show this mode, though it was told it.
    Mode(Mode),
    /// It does not come to a stand, so that its mode cannot be changed.
    Moving,
    /// An object was not read or written.
    Object {
        /// Which.
        address: Address,
        /// Why.
        failure: sdo::Failure,
    },
    /// A following error.
    Following,
    /// It did not find home.
    Homing,
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fault(None) => f.write_str("fault"),
            Self::Fault(Some(code)) => write!(f, "fault {code:04X}h"),
            Self::Local => f.write_str("not in remote control"),
            Self::Stuck(state) => write!(f, "it stays in {state}"),
            Self::NoMode(mode) => write!(f, "it has no mode {mode}"),
            Self::NoSync => f.write_str("there is no SYNC"),
            Self::Mode(mode) => write!(f, "it does not go to mode {mode}"),
            Self::Moving => f.write_str("it does not come to a stand"),
            Self::Object { address, failure } => write!(f, "{address}: {failure}"),
            Self::Following => f.write_str("following error"),
            Self::Homing => f.write_str("homing error"),
        }
    }
}

/// Why nothing is wanted of a drive any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// It is not there, or not ready to take orders.
    NotPresent,
    /// A fault; its emergency code, where it has sent one.
    Fault(Option<u16>),
    /// It went to this state by itself, or by another's command.
    Left(State),
    /// It shows no sign any more.
    Lost,
    /// It has booted: it knows nothing of what was wanted.
    Rebooted,
    /// Its network state is this: it does not hear of what is wanted.
    NotOperational(nmt::State),
    /// The bus is off: what it was told is not known.
    Bus,
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPresent => f.write_str("not present"),
            Self::Fault(None) => f.write_str("fault"),
            Self::Fault(Some(code)) => write!(f, "fault {code:04X}h"),
            Self::Left(state) => write!(f, "{state}"),
            Self::Lost => f.write_str("lost"),
            Self::Rebooted => f.write_str("booted again"),
            Self::NotOperational(state) => write!(f, "its node is {state}"),
            Self::Bus => f.write_str("the bus is off"),
        }
    }
}

/// What the caller has to do, or to know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Send this frame.
    Transmit(Frame),
    /// What a drive is at.
    Reported {
        /// Its place in the order of [`Master::new`](super::Master::new).
        place: usize,
        /// What it is at.
        report: Report,
        /// It tells of what is wanted now; otherwise it may tell of what was before.
        current: bool,
    },
    /// What was wanted of a drive has been taken back: Observe is wanted now. What is said again without something else in
    /// between does not count.
    Fell {
        /// Its place.
        place: usize,
        /// Why.
        why: Why,
    },
    /// What the manager has to say, but for frames, and for transfers of the drives.
    Manager(manager::Action),
    /// Nothing until something is heard or wanted, or the time of [`Master::poll_at`](super::Master::poll_at).
    Idle,
}
