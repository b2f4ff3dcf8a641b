//! What goes into a manager and comes out of it.

use core::fmt;
use core::time::Duration;

use heapless::Vec;
use puente_line::Instant;

use crate::boot::{Plan, Verdict};
use crate::emcy::Emergency;
use crate::monitor::{self, Supervision};
use crate::nmt::State;
use crate::sdo::{self, SEGMENT};
use crate::{Address, Frame, Id, NodeId, lss, sync};

/// How a manager works its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Its own node-ID.
    pub node: NodeId,
    /// Period of SYNC (1006h), whole microseconds; zero: none.
    pub sync: Duration,
    /// SYNC has a counter that overflows there (1019h).
    pub overflow: Option<sync::Overflow>,
    /// Its own heartbeat comes so often (1017h); zero: never.
    pub heartbeat: Duration,
    /// TIME is told so often, once [`Manager::set_time`](super::Manager::set_time) has said it; zero: never.
    pub time: Duration,
    /// How objects are read and written, where a transfer does not say otherwise.
    pub sdo: sdo::Config,
    /// An LSS node answers within so long.
    pub lss: Duration,
    /// A member that is missing or lost is tried again so often; one that is refused, or leaves its state after it was
    /// configured, after so long, then after twice that, up to 64 times: there are drives that keep each value written to them
    /// in a memory that wears.
    pub retry: Duration,
    /// Somebody babbles when more frames than this of one COB-ID come within 100 ms, see [`babble_limit`]; 0: nobody does.
    /// More than SYNC and the PDOs that come with it.
    pub babble: u16,
}

/// What [`Config::babble`] may be at a bit rate: a third of the frames of eight bytes that the bus carries, 5 at
/// least.
pub const fn babble_limit(bitrate: u32) -> u16 {
    let third = bitrate / 10 / 3 / Frame::worst_bits(false, 8);
    match third {
        0..5 => 5,
        5..0xFFFF => third as u16,
        _ => u16::MAX,
    }
}

impl Config {
    /// No SYNC, no TIME, a heartbeat each second, LSS answers within 100 ms, retries each second, and the
    /// [`babble_limit`] of 1 Mbit/s.
    pub const fn new(node: NodeId) -> Self {
        Self {
            node,
            sync: Duration::ZERO,
            overflow: None,
            heartbeat: Duration::from_secs(1),
            time: Duration::ZERO,
            sdo: sdo::Config::DEFAULT,
            lss: Duration::from_millis(100),
            retry: Duration::from_secs(1),
            babble: babble_limit(1_000_000),
        }
    }
}

/// A configured node.
#[derive(Clone, Copy, Debug)]
pub struct Member<'a> {
    /// Which.
    pub id: NodeId,
    /// What it is to be.
    pub plan: Plan<'a>,
    /// How it is watched once it has booted.
    pub supervision: Supervision,
    /// Nobody minds when it is missing.
    pub optional: bool,
    /// Its communication is reset when the manager starts. Not for what may be moving.
    pub reset: bool,
}

impl Member<'_> {
    /// A mandatory node of which nothing is asked; it is not watched and not started.
    pub const fn new(id: NodeId) -> Self {
        Self { id, plan: Plan::NOTHING, supervision: Supervision::Off, optional: false, reset: false }
    }
}

/// What the caller has to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Send this frame.
    Transmit(Frame),
    /// The transfer with this node goes on.
    Sdo(NodeId, Sdo),
    /// Something happened to this node.
    Node(NodeId, Event),
    /// Something happened on the bus.
    Bus(BusEvent),
    /// The LSS command is done.
    Lss(Result<lss::Outcome, lss::Failure>),
    /// Nothing until the next frame, the next call, or the time of [`Manager::poll_at`](super::Manager::poll_at).
    Idle,
}

/// What a transfer needs or brings.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sdo {
    /// Call [`Manager::supply`](super::Manager::supply) at once with these bytes of what is written. They may be asked for
    /// again.
    Fetch {
        /// Of the first of them.
        offset: u32,
        /// How many, 1 to 7.
        count: usize,
    },
    /// The next bytes of what is read. They are the object's only when the transfer ends well.
    Data(Vec<u8, SEGMENT>),
    /// The transfer is over, and the node may be asked for something else.
    Done(Result<sdo::Outcome, sdo::Failure>),
}

/// What happened to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// It has booted, changed its state, is lost or back.
    Monitor(monitor::Event),
    /// It reports this.
    Emergency(Emergency),
    /// The member is who it is to be, configured, and has been told to start where it is to.
    Booted,
    /// The member has not taken a value that it need not take.
    Declined(Address, sdo::Abort),
    /// The member answers, but is not booted. Told once for each verdict.
    NotBooted(Verdict),
    /// The member does not answer, and is not optional. Told once.
    Missing,
    /// Two nodes have this node-ID. Told once until it boots.
    DuplicateId(Evidence),
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Monitor(event) => event.fmt(f),
            Self::Emergency(emergency) => emergency.fmt(f),
            Self::Booted => f.write_str("configured"),
            Self::Declined(address, code) => write!(f, "does not take {address}: {code}"),
            Self::NotBooted(verdict) => verdict.fmt(f),
            Self::Missing => f.write_str("missing"),
            Self::DuplicateId(evidence) => write!(f, "node-ID given twice: {evidence}"),
        }
    }
}

/// What shows that two nodes have the same node-ID.
///
/// Nodes of one node-ID that say all the same at the same time cannot be told from one; nor can a second one that is switched on
/// from one that boots again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// Somebody speaks under the manager's own.
    Own,
    /// Its SDO server says what nobody asked for. Not looked for where somebody else asks the server, too, nor after a
    /// transfer that did not end well or had to ask twice, until another one ends well.
    Response,
    /// Its state goes to and fro without a command: three times, each within five seconds of the one before.
    State,
    /// Its heartbeat comes almost twice as often as it was told: 14 times within eight periods.
    Heartbeat,
    /// It answers guarding twice. Not looked for where somebody else guards it, too.
    Guarding,
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Own => "it is the manager's own",
            Self::Response => "an SDO response nobody asked for",
            Self::State => "its state goes to and fro without a command",
            Self::Heartbeat => "a heartbeat twice as often as it was told",
            Self::Guarding => "two answers to guarding",
        })
    }
}

/// What happened on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusEvent {
    /// The controller is off the bus, or the port is not there: nothing is sent or heard.
    Off,
    /// It is back.
    On,
    /// Frames of this COB-ID come too often ([`Config::babble`]). Told once until it ends; what they say is still taken note
    /// of, but not told.
    Babbling(Id),
    /// They do not any more.
    Quiet(Id),
}

impl fmt::Display for BusEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => f.write_str("off the bus"),
            Self::On => f.write_str("on the bus again"),
            Self::Babbling(id) => write!(f, "somebody babbles {:03X}h", id.raw()),
            Self::Quiet(id) => write!(f, "nobody babbles {:03X}h any more", id.raw()),
        }
    }
}

/// What is known of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// Its state; not before its first sign since its boot-up, and not while it is lost.
    pub state: Option<State>,
    /// What became of it as a member.
    pub health: Health,
    /// When it was heard last, to the second: its signs, emergencies and SDO responses.
    pub heard: Option<Instant>,
    /// Its last error that is not over.
    pub emergency: Option<Emergency>,
    /// Somebody else has its node-ID, too.
    pub duplicate: bool,
}

/// What became of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// It is no member.
    Unmanaged,
    /// It has not been heard yet, or was told to reset.
    Absent,
    /// It is being judged and configured.
    Booting,
    /// It is who it is to be, and configured.
    Booted,
    /// It was booted, and shows no sign any more.
    Lost,
    /// It is there, but not booted.
    Refused(Verdict),
}

impl fmt::Display for Health {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unmanaged => f.write_str("not configured"),
            Self::Absent => f.write_str("absent"),
            Self::Booting => f.write_str("booting"),
            Self::Booted => f.write_str("booted"),
            Self::Lost => f.write_str("lost"),
            Self::Refused(verdict) => write!(f, "refused: {verdict}"),
        }
    }
}

/// Why an NMT command is not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsent {
    /// Too many wait already.
    Full,
    /// The bus is off.
    Off,
}

impl fmt::Display for Unsent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Full => "too many NMT commands wait",
            Self::Off => "the bus is off",
        })
    }
}

impl core::error::Error for Unsent {}

/// Events since the manager was made, each modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Of all SDO channels.
    pub sdo: sdo::Counters,
    /// SYNCs left out because the caller came a whole period late, or the bus was off.
    pub sync_missed: u32,
    /// Times that the bus was off.
    pub bus_offs: u32,
    /// Members booted.
    pub booted: u32,
    /// Emergencies heard, of all nodes.
    pub emergencies: u32,
    /// Events of nodes that were not told, for the caller did not poll or somebody babbled.
    pub untold: u32,
}
