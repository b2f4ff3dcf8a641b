//! The bounded pool of requests, and the fair choice of the next one for a bus.

use core::task::Waker;

use embassy_sync::waitqueue::WakerRegistration;
use heapless::Vec;
use puente_line::Instant;
use puente_modbus::request::Request;
use puente_modbus::{Outcome, Pdu};

use super::fair::Rank;
use super::{Class, Desk, Failure, Order, Reason};
use crate::bus::{End, Haste, Job, Next, Ticket, Work};
use crate::port::limits::{PIPELINE, TICKETS};

/// Places that only a stop may take, so that there always is one.
const STOP_RESERVE: usize = 4;

enum Phase {
    Free,
    Queued,
    OnWire,
    Answered(Result<(), Failure>),
}

struct Entry {
    phase: Phase,
    /// Nobody waits for the answer any more.
    abandoned: bool,
    seat: u8,
    bus: u8,
    unit: u8,
    class: Class,
    /// The request, or its reply.
    pdu: Pdu,
    /// Order of arrival.
    serial: u32,
    arrived: Instant,
    deadline: Instant,
    waker: WakerRegistration,
}

impl Entry {
    const fn free() -> Self {
        Self {
            phase: Phase::Free,
            abandoned: false,
            seat: 0,
            bus: 0,
            unit: 0,
            class: Class::Free,
            pdu: Pdu::new(),
            serial: 0,
            arrived: Instant::ZERO,
            deadline: Instant::ZERO,
            waker: WakerRegistration::new(),
        }
    }

    /// A stop goes out in the quarantine of its slave too, where its reply repeats all of it: no late reply can be taken
    /// for that, but one to the same stop. Function 10h does not repeat its values.
    fn haste(&self) -> Haste {
        use puente_modbus::request::Request::{MaskWriteRegister, WriteSingleRegister};
        let repeats =
            || matches!(Request::parse(&self.pdu), Ok(WriteSingleRegister { .. } | MaskWriteRegister { .. }));
        if self.class == Class::Stop && repeats() { Haste::InQuarantineToo } else { Haste::None }
    }

    fn answer(&mut self, result: Result<(), Failure>) {
        self.phase = if self.abandoned { Phase::Free } else { Phase::Answered(result) };
        self.waker.wake();
    }
}

/// Empty at first, so that a static one takes no flash.
pub(super) struct Queue {
    entries: Vec<Entry, TICKETS>,
    serial: u32,
}

impl Queue {
    pub(super) const fn new() -> Self {
        Self { entries: Vec::new(), serial: 0 }
    }

    pub(super) fn used(&self) -> usize {
        self.entries.iter().filter(|entry| !matches!(entry.phase, Phase::Free)).count()
    }

    pub(super) fn waiting(&self, bus: u8) -> usize {
        self.entries.iter().filter(|e| matches!(e.phase, Phase::Queued) && e.bus == bus).count()
    }

    /// Takes a request in, or none where the pool or this client's share of it is full.
    pub(super) fn insert(
        &mut self,
        order: &Order<'_>,
        arrived: Instant,
        deadline: Instant,
    ) -> Option<Ticket> {
        if order.class != Class::Stop {
            let of_seat = |e: &&Entry| !matches!(e.phase, Phase::Free) && e.seat == order.seat;
            if self.entries.iter().filter(of_seat).count() >= PIPELINE
                || self.used() + STOP_RESERVE >= TICKETS
            {
                return None;
            }
        }
        let free = self.entries.iter().position(|entry| matches!(entry.phase, Phase::Free));
        let index = free.unwrap_or(self.entries.len());
        if free.is_none() {
            self.entries.push(Entry::free()).ok()?;
        }
        let entry = self.entries.get_mut(index)?;
        entry.pdu.clear();
        entry.pdu.extend_from_slice(order.pdu).ok()?;
        entry.phase = Phase::Queued;
        entry.abandoned = false;
        (entry.seat, entry.bus, entry.unit, entry.class) = (order.seat, order.bus, order.unit, order.class);
        (entry.arrived, entry.deadline) = (arrived, deadline);
        self.serial = self.serial.wrapping_add(1);
        entry.serial = self.serial;
        entry.waker = WakerRegistration::new();
        Some(Ticket(index as u16))
    }

    /// What `f` makes of the answer, where there is one; else `waker` is woken when there is.
    pub(super) fn collect<T>(
        &mut self,
        ticket: Ticket,
        waker: &Waker,
        f: impl FnOnce(Result<&[u8], Failure>) -> T,
    ) -> Option<T> {
        let entry = self.entries.get_mut(usize::from(ticket.0))?;
        let Phase::Answered(result) = entry.phase else {
            entry.waker.register(waker);
            return None;
        };
        entry.phase = Phase::Free;
        Some(f(result.map(|()| entry.pdu.as_slice())))
    }

    /// Nobody waits for this request any more.
    pub(super) fn give_up(&mut self, ticket: Ticket) {
        if let Some(entry) = self.entries.get_mut(usize::from(ticket.0)) {
            match entry.phase {
                Phase::OnWire => entry.abandoned = true,
                Phase::Queued if entry.class == Class::Stop => entry.abandoned = true,
                Phase::Free | Phase::Queued | Phase::Answered(_) => entry.phase = Phase::Free,
            }
        }
    }
}

/// The desk as one bus sees it.
pub struct BusQueue<'d> {
    /// The desk.
    pub desk: &'d Desk,
    /// Index of the bus.
    pub bus: u8,
}

impl Work for BusQueue<'_> {
    fn next(&self, now: Instant, ready_at: impl Fn(u8, Haste) -> Instant) -> Next {
        self.desk.with(|state| {
            let Some(bus) = state.buses.get_mut(usize::from(self.bus)) else {
                return Next::Wait(None);
            };
            let mut wake: Option<Instant> = None;
            let mut best: Option<(Rank, usize)> = None;
            for (index, entry) in state.queue.entries.iter_mut().enumerate() {
                if !matches!(entry.phase, Phase::Queued) || entry.bus != self.bus {
                    continue;
                }
                let refusal = match entry.class {
                    Class::Stop => None,
                    _ if entry.deadline <= now => Some(Reason::Expired),
                    Class::Probe => None,
                    Class::Motion(permit) | Class::Guarded(permit) if !permit.valid(&state.leases, now) => {
                        Some(Reason::Stopped)
                    }
                    Class::Motion(_) | Class::Guarded(_) | Class::Free => {
                        bus.breaker.rest(entry.unit, now).map(Reason::Resting)
                    }
                };
                if let Some(reason) = refusal {
                    bus.statistics.not_sent(reason);
                    entry.answer(Err(Failure::NotSent(reason)));
                    continue;
                }
                let ready = ready_at(entry.unit, entry.haste());
                if ready > now {
                    let moment = ready.min(entry.deadline);
                    wake = Some(wake.map_or(moment, |wake| wake.min(moment)));
                    continue;
                }
                let rank = bus.fair.rank(entry.class, entry.seat, entry.serial);
                if best.is_none_or(|(other, _)| rank < other) {
                    best = Some((rank, index));
                }
            }
            let Some((index, entry)) = best.and_then(|(_, i)| Some((i, state.queue.entries.get_mut(i)?)))
            else {
                return Next::Wait(wake);
            };
            entry.phase = Phase::OnWire;
            bus.fair.served(entry.class, entry.seat);
            Next::Job(Job { ticket: Ticket(index as u16), unit: entry.unit, haste: entry.haste() })
        })
    }

    fn request<R>(&self, ticket: Ticket, f: impl FnOnce(&[u8]) -> R) -> R {
        self.desk.with(|state| {
            let entry = state.queue.entries.get(usize::from(ticket.0));
            f(entry.map_or(&[], |entry| entry.pdu.as_slice()))
        })
    }

    async fn changed(&self) {
        match self.desk.work.get(usize::from(self.bus)) {
            Some(signal) => signal.wait().await,
            None => core::future::pending().await,
        }
    }

    fn finish(&self, now: Instant, ticket: Ticket, end: End<'_>) {
        self.desk.with(|state| {
            let bus = state.buses.get_mut(usize::from(self.bus));
            let entry = state.queue.entries.get_mut(usize::from(ticket.0));
            let (Some(bus), Some(entry)) = (bus, entry) else {
                return;
            };
            let result = match end {
                End::Master(Outcome::Reply(reply)) => {
                    bus.breaker.answered(entry.unit);
                    bus.statistics.answered(now.since(entry.arrived), reply);
                    entry.pdu.clear();
                    // A reply PDU is at most MAX_PDU bytes: the master bounds it.
                    let _ = entry.pdu.extend_from_slice(reply);
                    Ok(())
                }
                End::Master(Outcome::Broadcast) => {
                    bus.statistics.broadcasts += 1;
                    entry.pdu.clear();
                    Ok(())
                }
                End::Master(Outcome::NoReply(evidence)) => {
                    bus.breaker.missed(entry.unit, now);
                    bus.statistics.no_reply += 1;
                    Err(Failure::NoReply(evidence))
                }
                End::NotSent => {
                    bus.statistics.not_sent(Reason::LineDown);
                    Err(Failure::NotSent(Reason::LineDown))
                }
                End::LineDown => {
                    bus.statistics.no_reply += 1;
                    Err(Failure::NoReply(puente_modbus::Evidence::Line))
                }
            };
            entry.answer(result);
        });
    }

    fn alive(&self, until: Instant) {
        self.desk.with(|state| {
            if let Some(bus) = state.buses.get_mut(usize::from(self.bus)) {
                bus.alive_until = Some(until);
            }
        });
    }

    fn counted(&self, counters: puente_modbus::Counters) {
        self.desk.with(|state| {
            if let Some(bus) = state.buses.get_mut(usize::from(self.bus)) {
                bus.statistics.line = counters;
            }
        });
    }
}
