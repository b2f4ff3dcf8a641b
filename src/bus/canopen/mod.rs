//! CANopen buses: the manager of a bus, and the [pump](pump()) that drives it.

mod pump;

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use puente_canopen::manager::{BusEvent, Config, Counters, Event, Manager, Member};
use puente_canopen::sdo::SEGMENT;
use puente_canopen::{Frame, NodeId, lss, nmt, sdo};
use puente_line::{Duration, Instant};
use puente_servos::{Axis, Order as Wanted, Report, Why};

use super::{Image, Taken, Undelivered};
use crate::clock;
use crate::port::limits::{CHANNELS, DRIVES, MEMBERS, SDO_DATA};
use crate::port::{CanCounters, CanState};

pub use pump::{Setup, pump};

/// Segments of the longest block that is read: as many as there is room for, with one more that is on its way.
const BLOCK: usize = if SDO_DATA / SEGMENT > 127 { 127 } else { SDO_DATA / SEGMENT - 1 };
/// Bytes that come at most until whoever reads can be made to wait.
pub const ROOM: usize = (BLOCK + 1) * SEGMENT;

/// The manager of a bus, with its drives.
pub type Master = puente_servos::Master<'static, DRIVES, MEMBERS, CHANNELS>;
/// What it knows of nodes.
pub type Nodes = Manager<'static, MEMBERS, CHANNELS>;

/// Where the manager of a bus lives. Its pump works it; what it knows may be read by everybody, for a moment at a time.
pub struct Room(Mutex<CriticalSectionRawMutex, RefCell<Master>>);

impl Room {
    /// With a manager that does nothing yet, and has no members.
    #[inline(always)]
    pub fn new(config: Config) -> Self {
        Self(Mutex::new(RefCell::new(Master::without_members(config))))
    }

    /// Gives the manager its members and drives.
    pub fn join(
        &self,
        members: impl IntoIterator<Item = Member<'static>>,
        axes: impl IntoIterator<Item = Axis>,
    ) {
        self.work(|master| master.join(members, axes, clock::now()));
    }

    /// Reads what the manager knows.
    pub fn look<R>(&self, f: impl FnOnce(&Nodes) -> R) -> R {
        self.0.lock(|master| f(master.borrow().manager()))
    }

    /// Works it.
    fn work<R>(&self, f: impl FnOnce(&mut Master) -> R) -> R {
        self.0.lock(|master| f(&mut master.borrow_mut()))
    }
}

/// What somebody wants of the manager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// A transfer with a node, which has so long for each answer, where it is said.
    Transfer(NodeId, sdo::Transfer, Option<Duration>),
    /// The transfer with a node is given up.
    Cancel(NodeId),
    /// There is room for what the transfer with a node reads.
    Resume(NodeId),
    /// An NMT command to a node, or to all.
    Nmt(nmt::Command, Option<NodeId>),
    /// An LSS command, each of whose questions is answered within so long, where it is said.
    Lss(lss::Command, Option<Duration>),
    /// The LSS command in work is given up.
    CancelLss,
}

/// Where the pump of a CANopen bus finds what is wanted, and tells what becomes of it and what is heard.
pub trait Exchange {
    /// Shows each order that waits; `take` tells whether the manager has taken it. When to be called again for what expires.
    fn orders(&self, now: Instant, take: impl FnMut(Order) -> bool) -> Option<Instant>;
    /// Shows the frame that waits for the bus, if there is one and it may still go.
    fn outgoing(&self, now: Instant, take: impl FnOnce(&Frame) -> Taken);
    /// What has become of the frame that was taken last.
    fn posted(&self, now: Instant, outcome: Result<(), Undelivered>);

    /// Shows what is to be written to a node: so many bytes at most, from `offset` on.
    fn fetch(&self, node: NodeId, offset: u32, count: usize, f: impl FnOnce(&[u8]));
    /// The next bytes that are read from a node; false when there is no room for another block.
    fn read(&self, node: NodeId, bytes: &[u8]) -> bool;
    /// The transfer with a node is over.
    fn done(&self, now: Instant, node: NodeId, end: Result<sdo::Outcome, sdo::Failure>);
    /// The LSS command is done.
    fn lss(&self, end: Result<lss::Outcome, lss::Failure>);

    /// A frame of another node.
    fn heard(&self, now: Instant, frame: &Frame);
    /// A frame of the manager's own is on its way.
    fn sent(&self, now: Instant, frame: &Frame);
    /// Something happened to a node,
    fn happened(&self, now: Instant, node: NodeId, event: Event);
    /// or on the bus.
    fn happened_on_bus(&self, now: Instant, event: BusEvent);
    /// The state of the port is another one.
    fn state(&self, now: Instant, state: CanState);
    /// What was counted so far.
    fn counted(&self, port: CanCounters, manager: Counters);
}

/// The [`Image`] of a CANopen bus, whose axes are CiA 402 drives.
pub trait Drives: Image<Output = Wanted, Report = Report, Fall = Why> {}

impl<T: Image<Output = Wanted, Report = Report, Fall = Why>> Drives for T {}
