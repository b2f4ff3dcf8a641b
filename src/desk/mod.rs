//! Between the clients and the buses: bounded queues, fair order, deadlines, the circuit breaker of each slave and the
//! commander's lease.
//!
//! A client's request is [`submit`](Desk::submit)ted and becomes a [`Pending`], which has the answer in time: the reply
//! PDU (exceptions of the slave included; empty after a broadcast), or a [`Failure`]. Nothing
//! is queued without bound, nothing is sent twice, and what is dropped before it was sent never is.

mod breaker;
mod can;
mod duty;
mod fair;
mod image;
mod lease;
mod mail;
mod pending;
mod queue;
mod route;
mod seats;
mod statistics;
mod turn;

use core::cell::RefCell;
use core::fmt;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use heapless::Vec;
use puente_framed::arbiter::Failure as LineFailure;
use puente_line::{Duration, Instant};
use puente_modbus::Evidence;

pub use can::{
    CanBus, CanFailure, CanFollower, CanSpec, CanStatistics, Heard, Lost, LssFailure, Origin, SdoOrder,
    SdoPending, SdoTransfer, What,
};
pub use duty::Duty;
pub use image::{BusImage, Feedback, Input, Kind, Modules, Motion, Servos, View, Wish, at_rest};
pub use lease::{Cause, Event, Holder, Leased, Permit};
pub use mail::{Follower, Frame, MailStatistics, Turn};
pub use pending::Pending;
pub use queue::BusQueue;
pub use route::Units;
pub use statistics::{BUCKETS_MS, Statistics, Traffic};
pub use turn::Permits;

use crate::port::limits::{AXES, BUSES, TICKETS};

/// Why a request has no reply. The two cases differ in what the drive may have done.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// The request never was on the wire.
    NotSent(Reason),
    /// The request was sent once, and no usable reply came. A write may or may not have been executed.
    NoReply(Evidence),
}

/// Why a request was not sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// No bus serves this unit id.
    Unmapped,
    /// Too many requests wait already.
    QueueFull,
    /// It waited too long for its turn.
    Expired,
    /// The slave has not answered lately; it is asked again after this time.
    Resting(Duration),
    /// A stop, or the end of the lease, came first.
    Stopped,
    /// The port of the bus failed.
    LineDown,
    /// What shares the line does not let it pass.
    Line(LineFailure),
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::NotSent(reason) => write!(f, "not sent: {reason}"),
            Failure::NoReply(evidence) => write!(f, "sent, no reply: {evidence}"),
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::Unmapped => f.write_str("no bus serves this unit"),
            Reason::QueueFull => f.write_str("too many requests are waiting"),
            Reason::Expired => f.write_str("it waited too long for its turn on the bus"),
            Reason::Resting(left) => {
                write!(
                    f,
                    "the slave did not answer lately and is tried again in {} ms",
                    puente_line::millis(*left)
                )
            }
            Reason::Stopped => f.write_str("a stop or the end of the lease came first"),
            Reason::LineDown => {
                f.write_str("the port of the bus failed; see to its adapter, cable and termination")
            }
            // Without an echo an answer looks like a collision.
            Reason::Line(failure @ (LineFailure::NoEcho | LineFailure::Collisions { .. })) => {
                write!(
                    f,
                    "{failure}; an adapter that gives nothing back of what is sent needs echo = \"off\""
                )
            }
            Reason::Line(failure) => failure.fmt(f),
        }
    }
}

/// What a request may do, which decides its place in the queue and what can revoke it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Stops or disables a drive: goes first, past every rest and quarantine, and cannot be revoked. It is sent even
    /// where its client is gone.
    Stop,
    /// Is to start motion: as `Guarded`, and every other turn is for such requests where there are any.
    Motion(Permit),
    /// Acts on an axis: is dropped when its permit has been revoked before it was sent.
    Guarded(Permit),
    /// Asks whether a slave is there: goes to resting slaves too.
    Probe,
    /// Anything else.
    Free,
}

/// A request for a bus.
pub struct Order<'a> {
    /// The client's place, for a fair order.
    pub seat: u8,
    /// Index of the bus.
    pub bus: u8,
    /// Modbus address, 0 for a broadcast.
    pub unit: u8,
    /// What it may do.
    pub class: Class,
    /// Function code and data.
    pub pdu: &'a [u8],
}

/// What the desk has to know of a bus.
#[derive(Clone, Debug)]
pub struct BusSpec {
    /// Unit ids that Modbus clients reach on this bus.
    pub units: Units,
    /// How long a request may wait for its turn.
    pub queue_timeout: Duration,
    /// How long a slave has for its reply.
    pub reply_timeout: Duration,
}

struct Bus {
    spec: BusSpec,
    breaker: breaker::Breaker,
    statistics: Statistics,
    fair: fair::Fair,
    /// Before this moment its pump gives the next sign of life; none until the first.
    alive_until: Option<Instant>,
    /// Of a cyclic bus.
    cycles: puente_modules::master::Statistics,
    /// Its port has failed.
    line_down: bool,
}

struct State {
    queue: queue::Queue,
    buses: Vec<Bus, BUSES>,
    leases: Vec<lease::AxisLease, AXES>,
    image: image::Slots,
    lease_time: Duration,
    mail: mail::Mail,
    can: can::Can,
    seats: seats::Seats,
}

/// The desk. One for the whole gateway, shared by every task.
pub struct Desk {
    state: Mutex<CriticalSectionRawMutex, RefCell<State>>,
    outgoing: mail::Outgoing,
    work: [Signal<CriticalSectionRawMutex, ()>; BUSES],
    leases_changed: [Signal<CriticalSectionRawMutex, ()>; AXES],
}

impl Default for Desk {
    fn default() -> Self {
        Self::new()
    }
}

impl Desk {
    /// A desk without buses, for a static. It is all zeros, which take no flash.
    pub const fn new() -> Self {
        Self {
            state: Mutex::new(RefCell::new(State {
                queue: queue::Queue::new(),
                buses: Vec::new(),
                leases: Vec::new(),
                image: Vec::new(),
                lease_time: Duration::ZERO,
                mail: mail::Mail::new(),
                can: can::Can::new(),
                seats: seats::Seats::new(),
            })),
            outgoing: mail::Outgoing::new(mail::Frame::new()),
            work: [const { Signal::new() }; BUSES],
            leases_changed: [const { Signal::new() }; AXES],
        }
    }

    /// Gives it its buses, at most [`BUSES`], and how long a silent commander keeps its axes. Before anything else.
    pub fn configure(&self, specs: impl IntoIterator<Item = BusSpec>, lease_time: Duration) {
        self.with(|state| {
            state.lease_time = lease_time;
            state.leases = core::iter::repeat_with(lease::AxisLease::new).take(AXES).collect();
            state.image = core::iter::repeat_with(|| None).take(AXES).collect();
            for spec in specs.into_iter().take(BUSES) {
                let breaker = breaker::Breaker::new(spec.reply_timeout);
                // There is room: no more than BUSES are taken.
                let statistics = Statistics::default();
                let bus = Bus {
                    spec,
                    breaker,
                    statistics,
                    fair: fair::Fair::new(),
                    alive_until: None,
                    cycles: Default::default(),
                    line_down: false,
                };
                let _ = state.buses.push(bus);
            }
        });
    }

    fn with<R>(&self, f: impl FnOnce(&mut State) -> R) -> R {
        self.state.lock(|state| f(&mut state.borrow_mut()))
    }

    /// Tells the pump of a bus that there is something to do.
    fn work(&self, bus: Option<u8>) {
        if let Some(signal) = bus.and_then(|bus| self.work.get(usize::from(bus))) {
            signal.signal(());
        }
    }

    /// The bus that serves a unit id from 1 to 255.
    pub fn route(&self, unit: u8) -> Option<u8> {
        self.with(|state| state.buses.iter().position(|bus| bus.spec.units.contains(unit))).map(|i| i as u8)
    }

    /// The buses that serve any unit: those that a broadcast goes to.
    pub fn unit_buses(&self) -> Vec<u8, BUSES> {
        let served = |bus: &Bus| bus.spec.units.iter().next().is_some();
        self.with(|state| (0..).zip(&state.buses).filter(|(_, bus)| served(bus)).map(|(at, _)| at).collect())
    }

    /// What was counted on a bus.
    pub fn statistics(&self, bus: u8) -> Option<Statistics> {
        self.with(|state| {
            let waiting = state.queue.waiting(bus);
            let bus = state.buses.get(usize::from(bus))?;
            Some(Statistics { waiting, resting: bus.breaker.resting(), ..bus.statistics.clone() })
        })
    }

    /// The buses at a glance.
    pub fn traffic(&self) -> Traffic {
        self.with(|state| {
            let resting = state.buses.iter().any(|bus| bus.line_down || bus.breaker.resting() > 0);
            let of_bus = |bus: &Bus| bus.statistics.on_line().wrapping_add(bus.cycles.cycles);
            let on_line = state.buses.iter().map(of_bus);
            Traffic { transactions: on_line.fold(0, u32::wrapping_add), resting }
        })
    }

    /// A bus whose pump has not given the sign of life that it owes, if there is one: it hangs.
    pub fn hung(&self, now: Instant) -> Option<u8> {
        let late = |bus: &Bus| bus.alive_until.is_some_and(|until| until < now);
        self.with(|state| state.buses.iter().position(late)).map(|index| index as u8)
    }

    /// Places of the queue that are in use, and how many there are.
    pub fn tickets(&self) -> (usize, usize) {
        (self.with(|state| state.queue.used()), TICKETS)
    }

    /// Queues a request. It is answered, or dropped, within the bus's queue time-out plus one transaction.
    pub fn submit(&self, now: Instant, order: Order<'_>) -> Result<Pending<'_>, Failure> {
        let bus = usize::from(order.bus);
        let ticket = self.with(|state| {
            let found = state.buses.get_mut(bus).ok_or(Reason::Unmapped)?;
            let deadline = now + found.spec.queue_timeout;
            let ticket = state.queue.insert(&order, now, deadline);
            found.statistics.submitted += 1;
            if ticket.is_none() {
                found.statistics.not_sent(Reason::QueueFull);
            }
            ticket.ok_or(Reason::QueueFull)
        });
        let ticket = ticket.map_err(Failure::NotSent)?;
        self.work(Some(order.bus));
        Ok(Pending::new(self, ticket))
    }
}

#[cfg(test)]
mod tests;
