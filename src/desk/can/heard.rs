//! What was heard and what happened, for whoever follows.

use core::future::poll_fn;
use core::num::NonZeroU32;
use core::task::Poll;

use heapless::Vec;
use puente_canopen::manager::{BusEvent, Event};
use puente_canopen::{Frame, NodeId};
use puente_line::Instant;

use super::Can;
use crate::desk::Desk;
use crate::desk::seats::Seats;
use crate::port::CanState;
use crate::port::limits::CAN_HEARD;

/// Something on a CANopen bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// When.
    pub at: Instant,
    /// What.
    pub what: What,
}

/// What there was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum What {
    /// A frame.
    Frame {
        /// The frame.
        frame: Frame,
        /// Who sent it.
        origin: Origin,
    },
    /// Something happened to a node,
    Node(NodeId, Event),
    /// or on the bus.
    Bus(BusEvent),
    /// The state of the port is this now.
    State(CanState),
}

/// Who sent a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Another station of the bus.
    Bus,
    /// The gateway.
    Gateway,
    /// The client of a seat, through the gateway.
    Client(u8),
}

/// So much was lost, for the client was too slow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lost(pub NonZeroU32);

/// The newest of it, as much as there is room for.
pub(super) struct Ring {
    /// Each at its number modulo its room.
    kept: Vec<Heard, CAN_HEARD>,
    /// How many there ever were, modulo 2^32.
    count: u32,
}

impl Ring {
    pub(super) const fn new() -> Self {
        const { assert!(CAN_HEARD.is_power_of_two()) };
        Self { kept: Vec::new(), count: 0 }
    }

    fn push(&mut self, heard: Heard) {
        match self.kept.get_mut(self.count as usize % CAN_HEARD) {
            Some(place) => *place = heard,
            // The places are filled in their order.
            None => drop(self.kept.push(heard)),
        }
        self.count = self.count.wrapping_add(1);
    }

    /// What follows `mark`, which goes on behind it, or behind what is lost.
    fn next(&self, mark: &mut u32) -> Option<Result<Heard, Lost>> {
        let behind = self.count.wrapping_sub(*mark);
        if let Some(lost) = NonZeroU32::new(behind.saturating_sub(self.kept.len() as u32)) {
            *mark = mark.wrapping_add(lost.get());
            return Some(Err(Lost(lost)));
        }
        if behind == 0 {
            return None;
        }
        let next = self.kept.get(*mark as usize % CAN_HEARD).copied()?;
        *mark = mark.wrapping_add(1);
        Some(Ok(next))
    }
}

impl Can {
    /// Keeps it, where anybody follows the bus.
    pub(super) fn keep(&mut self, seats: &mut Seats, place: usize, at: Instant, what: What) {
        let (Some(bus), Some(ring)) = (self.buses.get(place), self.heard.get_mut(place)) else { return };
        if !bus.followers.is_empty() {
            ring.push(Heard { at, what });
            bus.followers.iter().for_each(|seat| seats.wake(*seat));
        }
    }
}

impl Desk {
    /// Follows a bus from now on, for the client of a seat; none where it is no CANopen bus, or too many follow it.
    pub fn follow_can(&self, seat: u8, bus: u8) -> Option<CanFollower<'_>> {
        self.with(|state| {
            let place = state.can.place(bus)?;
            state.can.buses.get_mut(place)?.followers.push(seat).ok()?;
            let mark = state.can.heard.get(place)?.count;
            Some(CanFollower { desk: self, seat, place, mark })
        })
    }
}

/// A client that follows a CANopen bus.
pub struct CanFollower<'d> {
    desk: &'d Desk,
    seat: u8,
    place: usize,
    mark: u32,
}

impl CanFollower<'_> {
    /// Waits for what comes next, or for how much of it this client has been too slow. Loses nothing when it is dropped.
    ///
    /// # Errors
    /// [`Lost`]; what was not lost comes after it.
    pub async fn heard(&mut self) -> Result<Heard, Lost> {
        poll_fn(|context| match self.next(|seats, seat| seats.register(seat, context.waker())) {
            Some(next) => Poll::Ready(next),
            None => Poll::Pending,
        })
        .await
    }

    /// The same, where there is something already.
    pub fn try_heard(&mut self) -> Option<Result<Heard, Lost>> {
        self.next(|_, _| {})
    }

    fn next(&mut self, nothing: impl FnOnce(&mut Seats, u8)) -> Option<Result<Heard, Lost>> {
        let Self { desk, seat, place, mark } = self;
        desk.with(|state| {
            let next = state.can.heard.get(*place)?.next(mark);
            match next {
                None => nothing(&mut state.seats, *seat),
                Some(Err(Lost(lost))) => {
                    if let Some(bus) = state.can.buses.get_mut(*place) {
                        bus.counted.lost(lost);
                    }
                }
                Some(Ok(_)) => {}
            }
            next
        })
    }
}

impl Drop for CanFollower<'_> {
    fn drop(&mut self) {
        self.desk.with(|state| {
            if let Some(bus) = state.can.buses.get_mut(self.place)
                && let Some(at) = bus.followers.iter().position(|seat| *seat == self.seat)
            {
                bus.followers.swap_remove(at);
            }
        });
    }
}
