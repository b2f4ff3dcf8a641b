//! CANopen buses: objects of nodes read and written for clients, NMT, LSS, frames of clients, and what is heard.
//!
//! Each node has one SDO channel, which its bus' manager works; clients take turns at it, by seat. All else that goes out
//! takes turns at one place a bus. What is heard and what happens is kept in a ring a bus, which each client follows at its own
//! pace; who is too slow is told how much it has lost.

mod exchange;
mod heard;
mod out;
mod sdo;
mod statistics;
#[cfg(test)]
mod tests;

use heapless::{Deque, Vec};
use puente_canopen::emcy::Emergency;
use puente_canopen::manager::{EMERGENCIES, Status};
use puente_canopen::{Frame, NodeId, lss, nmt};
use puente_line::{Duration, Instant};

pub use exchange::CanBus;
pub use heard::{CanFollower, Heard, Lost, Origin, What};
pub use out::LssFailure;
pub use sdo::{CanFailure, SdoOrder, SdoPending, SdoTransfer};
pub use statistics::CanStatistics;

use super::turn::Place;
use super::{Desk, Reason};
use crate::bus::Undelivered;
use crate::bus::canopen::Room;
use crate::port::CanState;
use crate::port::limits::{CANOPEN, SLOTS};

/// NMT commands that may wait until the pump has looked.
const COMMANDS: usize = 8;

/// What the desk has to know of a CANopen bus.
#[derive(Clone, Copy)]
pub struct CanSpec {
    /// Index of the bus.
    pub bus: u8,
    /// Its CiA 309-3 network number.
    pub net: u16,
    /// Bits per second.
    pub bitrate: u32,
    /// Where its manager lives.
    pub room: &'static Room,
}

/// Without buses it is all zeros.
pub(super) struct Can {
    buses: Vec<Bus, CANOPEN>,
    heard: [heard::Ring; CANOPEN],
    turns: [sdo::NodeTurns; CANOPEN],
    transfers: sdo::Transfers,
}

struct Bus {
    spec: CanSpec,
    state: CanState,
    /// Seats of those who follow it.
    followers: Vec<u8, SLOTS>,
    commands: Deque<(nmt::Command, Option<NodeId>), COMMANDS>,
    frame: Frame,
    frames: Place<Result<(), Undelivered>>,
    lss: (lss::Command, Option<Duration>),
    lss_place: Place<Result<lss::Outcome, lss::Failure>>,
    counted: statistics::Counted,
}

impl Can {
    pub(super) const fn new() -> Self {
        Self {
            buses: Vec::new(),
            heard: [const { heard::Ring::new() }; CANOPEN],
            turns: [sdo::NodeTurns::NEW; CANOPEN],
            transfers: sdo::Transfers::new(),
        }
    }

    /// The place of a bus among the CANopen buses.
    fn place(&self, bus: u8) -> Option<usize> {
        self.buses.iter().position(|other| other.spec.bus == bus)
    }

    fn bus(&mut self, bus: u8) -> Option<&mut Bus> {
        self.buses.iter_mut().find(|other| other.spec.bus == bus)
    }

    fn room(&self, bus: u8) -> Option<&'static Room> {
        self.buses.iter().find(|other| other.spec.bus == bus).map(|bus| bus.spec.room)
    }
}

impl Desk {
    /// A bus is a CANopen bus. Before anything else, after [`configure`](Desk::configure).
    pub fn add_can(&self, spec: CanSpec) {
        self.with(|state| {
            // No more than are allowed.
            let _ = state.can.buses.push(Bus {
                spec,
                state: CanState::Down,
                followers: Vec::new(),
                commands: Deque::new(),
                frame: nmt::Command::Stop.frame(None),
                frames: Place::new(),
                lss: (lss::Command::Store, None),
                lss_place: Place::new(),
                counted: statistics::Counted::default(),
            });
        });
    }

    /// The CANopen buses.
    pub fn can_buses(&self) -> Vec<u8, CANOPEN> {
        self.with(|state| state.can.buses.iter().map(|bus| bus.spec.bus).collect())
    }

    /// The bus of a CiA 309-3 network number.
    pub fn net(&self, number: u16) -> Option<u8> {
        self.with(|state| state.can.buses.iter().find(|bus| bus.spec.net == number).map(|bus| bus.spec.bus))
    }

    /// Its CiA 309-3 network number.
    pub fn net_of(&self, bus: u8) -> Option<u16> {
        self.with(|state| Some(state.can.bus(bus)?.spec.net))
    }

    /// What is known of a node.
    pub fn node(&self, bus: u8, node: NodeId) -> Option<Status> {
        let room = self.with(|state| state.can.room(bus))?;
        Some(room.look(|master| master.status(node)))
    }

    /// The nodes that are configured or have ever been heard, with what is known of each at the moment it comes.
    pub fn nodes(&self, bus: u8) -> impl Iterator<Item = (NodeId, Status)> {
        let room = self.with(|state| state.can.room(bus));
        room.into_iter().flat_map(|room| {
            NodeId::all()
                .filter_map(move |node| room.look(|master| master.known(node)).map(|status| (node, status)))
        })
    }

    /// The last emergencies of a node, the newest last; resets of errors are among them.
    pub fn emergencies(&self, bus: u8, node: NodeId) -> Vec<(Instant, Emergency), EMERGENCIES> {
        let room = self.with(|state| state.can.room(bus));
        room.map(|room| room.look(|master| master.emergencies(node).collect())).unwrap_or_default()
    }

    /// What was counted on a CANopen bus.
    pub fn can_statistics(&self, now: Instant, bus: u8) -> Option<CanStatistics> {
        self.with(|state| {
            let waiting = state.can.transfers.waiting(bus);
            let bus = state.can.bus(bus)?;
            Some(bus.counted.statistics(now, bus.state, bus.spec.bitrate, waiting))
        })
    }

    /// Commands this to a node, or with none to all; `permits` where it moves axes, or takes them from whom they belong to.
    ///
    /// # Errors
    /// Why it is not sent.
    pub fn nmt(
        &self,
        now: Instant,
        bus: u8,
        command: nmt::Command,
        node: Option<NodeId>,
        permits: &[super::Permit],
    ) -> Result<(), Reason> {
        self.with(|state| {
            let super::State { can, leases, .. } = state;
            let bus = can.bus(bus).ok_or(Reason::Unmapped)?;
            if !bus.state.sends() {
                return Err(Reason::LineDown);
            }
            if !permits.iter().all(|permit| permit.valid(leases, now)) {
                return Err(Reason::Stopped);
            }
            bus.commands.push_back((command, node)).map_err(|_| Reason::QueueFull)
        })?;
        self.work(Some(bus));
        Ok(())
    }
}
