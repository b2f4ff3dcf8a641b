//! Objects of nodes, read and written for clients.

use core::fmt;
use core::future::poll_fn;
use core::task::{Poll, Waker};

use embassy_sync::waitqueue::WakerRegistration;
use heapless::{Deque, Vec};
use puente_canopen::sdo::{Failure, Transfer};
use puente_canopen::{Address, NodeId};
use puente_line::{Duration, Instant};

use crate::bus::canopen::{Order, ROOM};
use crate::desk::fair::Fair;
use crate::desk::lease::AxisLease;
use crate::desk::{Class, Desk, Reason};
use crate::port::limits::{PIPELINE, SDO_DATA, TRANSFERS};

/// Places that only a stop may take, so that there always is one.
const STOP_RESERVE: usize = 2;
/// A transfer waits so long for its turn.
const QUEUE_TIMEOUT: Duration = Duration::from_secs(3);

/// A transfer with a node.
pub struct SdoOrder<'a> {
    /// The client's place, for a fair order.
    pub seat: u8,
    /// Index of the bus.
    pub bus: u8,
    /// With which node.
    pub node: NodeId,
    /// What it may do: reads are [`Class::Free`].
    pub class: Class,
    /// What is transferred.
    pub transfer: SdoTransfer<'a>,
    /// The node has so long for each answer; as the bus has it where none is said.
    pub timeout: Option<Duration>,
}

/// What is transferred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SdoTransfer<'a> {
    /// An object is read.
    Read {
        /// Which.
        address: Address,
        /// In blocks.
        block: bool,
    },
    /// An object is written.
    Write {
        /// Which.
        address: Address,
        /// Its bytes, at most [`SDO_DATA`].
        data: &'a [u8],
        /// In blocks.
        block: bool,
    },
}

/// Why a transfer did not end well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanFailure {
    /// Nothing of it was sent.
    NotSent(Reason),
    /// More than [`SDO_DATA`] bytes are to be written. Nothing of it was sent.
    TooLong,
    /// What came of it. What was to be written may have been written, but where the node refused.
    Sdo(Failure),
}

impl fmt::Display for CanFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CanFailure::NotSent(reason) => write!(f, "not sent: {reason}"),
            CanFailure::TooLong => write!(f, "not sent: at most {SDO_DATA} bytes can be written"),
            CanFailure::Sdo(failure) => failure.fmt(f),
        }
    }
}

/// Whose turn it is at each node of a bus.
#[derive(Clone, Copy)]
pub(super) struct NodeTurns([Fair; 128]);

impl NodeTurns {
    pub(super) const NEW: Self = Self([Fair::new(); 128]);

    /// There is one for each of them.
    fn of(&mut self, node: NodeId) -> Option<&mut Fair> {
        self.0.get_mut(usize::from(node.value()))
    }
}

/// Names a transfer between its order and its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ticket(u16);

enum Phase {
    Free,
    Queued,
    Running,
    Ended(Result<(), CanFailure>),
}

struct Entry {
    phase: Phase,
    /// Nobody waits for it any more.
    abandoned: bool,
    /// It has been given up.
    cancelled: bool,
    /// It waits for room.
    paused: bool,
    seat: u8,
    bus: u8,
    node: NodeId,
    class: Class,
    transfer: Transfer,
    timeout: Option<Duration>,
    /// Order of arrival.
    serial: u32,
    deadline: Instant,
    /// What is to be written; or what was read and not taken yet.
    data: Deque<u8, SDO_DATA>,
    waker: WakerRegistration,
}

impl Entry {
    fn is_of(&self, bus: u8, node: NodeId) -> bool {
        self.bus == bus && self.node == node && matches!(self.phase, Phase::Running)
    }

    fn has_room(&self) -> bool {
        SDO_DATA - self.data.len() >= ROOM
    }

    fn end(&mut self, result: Result<(), CanFailure>) {
        self.phase = if self.abandoned { Phase::Free } else { Phase::Ended(result) };
        self.waker.wake();
    }

    /// Why it is not begun.
    fn refusal(&self, now: Instant, leases: &[AxisLease], up: bool) -> Option<Reason> {
        match self.class {
            _ if !up => Some(Reason::LineDown),
            Class::Stop => None,
            _ if self.deadline <= now => Some(Reason::Expired),
            Class::Motion(permit) | Class::Guarded(permit) if !permit.valid(leases, now) => {
                Some(Reason::Stopped)
            }
            Class::Motion(_) | Class::Guarded(_) | Class::Probe | Class::Free => None,
        }
    }
}

/// Empty at first, so that a static one takes no flash.
pub(super) struct Transfers {
    entries: Vec<Entry, TRANSFERS>,
    serial: u32,
}

impl Transfers {
    pub(super) const fn new() -> Self {
        Self { entries: Vec::new(), serial: 0 }
    }

    pub(super) fn waiting(&self, bus: u8) -> usize {
        let queued = |entry: &&Entry| matches!(entry.phase, Phase::Queued) && entry.bus == bus;
        self.entries.iter().filter(queued).count()
    }

    fn insert(&mut self, now: Instant, order: &SdoOrder<'_>) -> Result<Ticket, CanFailure> {
        const FULL: CanFailure = CanFailure::NotSent(Reason::QueueFull);
        let used = |entry: &&Entry| !matches!(entry.phase, Phase::Free);
        if order.class != Class::Stop {
            let of_seat = self.entries.iter().filter(used).filter(|entry| entry.seat == order.seat).count();
            if of_seat >= PIPELINE || self.entries.iter().filter(used).count() + STOP_RESERVE >= TRANSFERS {
                return Err(FULL);
            }
        }
        let (transfer, bytes) = match order.transfer {
            SdoTransfer::Read { address, block } => (Transfer::Upload { address, block }, &[][..]),
            SdoTransfer::Write { address, data, block } => {
                (Transfer::Download { address, size: data.len() as u32, block }, data)
            }
        };
        let mut data = Deque::new();
        for byte in bytes {
            data.push_back(*byte).map_err(|_| CanFailure::TooLong)?;
        }
        self.serial = self.serial.wrapping_add(1);
        let entry = Entry {
            phase: Phase::Queued,
            abandoned: false,
            cancelled: false,
            paused: false,
            seat: order.seat,
            bus: order.bus,
            node: order.node,
            class: order.class,
            transfer,
            timeout: order.timeout,
            serial: self.serial,
            deadline: now + QUEUE_TIMEOUT,
            data,
            waker: WakerRegistration::new(),
        };
        let free = self.entries.iter().position(|entry| matches!(entry.phase, Phase::Free));
        let at = match free.and_then(|at| Some((at, self.entries.get_mut(at)?))) {
            Some((at, place)) => {
                *place = entry;
                at
            }
            None => {
                self.entries.push(entry).map_err(|_| FULL)?;
                self.entries.len() - 1
            }
        };
        Ok(Ticket(at as u16))
    }

    /// Shows the orders that wait for a bus. When the next of those that wait is too late; how many are not begun.
    pub(super) fn orders(
        &mut self,
        now: Instant,
        bus: u8,
        up: bool,
        turns: &mut NodeTurns,
        leases: &[AxisLease],
        take: &mut impl FnMut(Order) -> bool,
    ) -> (Option<Instant>, u32) {
        let mut not_sent = 0;
        // Nodes that take nothing now.
        let mut busy: u128 = 0;
        for entry in self.entries.iter_mut().filter(|entry| entry.bus == bus) {
            match entry.phase {
                Phase::Queued => {
                    if let Some(reason) = entry.refusal(now, leases, up) {
                        not_sent += 1;
                        entry.end(Err(CanFailure::NotSent(reason)));
                    }
                }
                Phase::Running => {
                    busy |= 1 << entry.node.value();
                    if entry.abandoned && !entry.cancelled && entry.class != Class::Stop {
                        entry.cancelled = take(Order::Cancel(entry.node));
                    }
                    if entry.paused && entry.has_room() {
                        entry.paused = !take(Order::Resume(entry.node));
                    }
                }
                Phase::Free | Phase::Ended(_) => {}
            }
        }
        while let Some(entry) = self.next(bus, busy, turns) {
            busy |= 1 << entry.node.value();
            if take(Order::Transfer(entry.node, entry.transfer, entry.timeout)) {
                entry.phase = Phase::Running;
                if let Some(turn) = turns.of(entry.node) {
                    turn.served(entry.class, entry.seat);
                }
            }
        }
        let queued =
            self.entries.iter().filter(|entry| matches!(entry.phase, Phase::Queued) && entry.bus == bus);
        (queued.map(|entry| entry.deadline).min(), not_sent)
    }

    /// The one whose turn it is at a node that is not busy.
    fn next(&mut self, bus: u8, busy: u128, turns: &mut NodeTurns) -> Option<&mut Entry> {
        let free = |entry: &&mut Entry| {
            matches!(entry.phase, Phase::Queued) && entry.bus == bus && busy >> entry.node.value() & 1 == 0
        };
        let rank =
            |entry: &&mut Entry| Some(turns.of(entry.node)?.rank(entry.class, entry.seat, entry.serial));
        self.entries.iter_mut().filter(free).min_by_key(rank)
    }

    fn running(&mut self, bus: u8, node: NodeId) -> Option<&mut Entry> {
        self.entries.iter_mut().find(|entry| entry.is_of(bus, node))
    }

    /// Shows what is to be written.
    pub(super) fn fetch(&mut self, bus: u8, node: NodeId, offset: u32, count: usize, f: impl FnOnce(&[u8])) {
        let bytes = self.running(bus, node).map(|entry| entry.data.make_contiguous().get(offset as usize..));
        let bytes = bytes.flatten().unwrap_or_default();
        f(bytes.get(..count).unwrap_or(bytes));
    }

    /// Takes what was read; false when there is no room for another block.
    pub(super) fn read(&mut self, bus: u8, node: NodeId, bytes: &[u8]) -> bool {
        let Some(entry) = self.running(bus, node) else { return true };
        for byte in bytes {
            // Whoever has gone needs nothing more. Others have room, for they are asked before.
            let _ = entry.data.push_back(*byte);
        }
        entry.waker.wake();
        // Until the manager has been told to go on, it waits: what has come meanwhile, and found room, does not tell it.
        entry.paused |= !entry.abandoned && !entry.has_room();
        !entry.paused
    }

    pub(super) fn done(&mut self, bus: u8, node: NodeId, end: Result<(), Failure>) {
        if let Some(entry) = self.running(bus, node) {
            entry.end(end.map_err(CanFailure::Sdo));
        }
    }

    /// What was read, or how it ended; else `waker` is woken when there is something. Whether the pump waits for room.
    fn collect(
        &mut self,
        ticket: Ticket,
        waker: &Waker,
        buffer: &mut [u8],
    ) -> (Poll<Result<usize, CanFailure>>, bool) {
        let Some(entry) = self.entries.get_mut(usize::from(ticket.0)) else { return (Poll::Pending, false) };
        let reads = matches!(entry.transfer, Transfer::Upload { .. });
        match entry.phase {
            Phase::Ended(Err(failure)) => {
                entry.phase = Phase::Free;
                return (Poll::Ready(Err(failure)), false);
            }
            Phase::Ended(Ok(())) if !reads || entry.data.is_empty() => {
                entry.phase = Phase::Free;
                return (Poll::Ready(Ok(0)), false);
            }
            _ if reads && !entry.data.is_empty() => {
                let mut count = 0;
                for (to, from) in buffer.iter_mut().zip(core::iter::from_fn(|| entry.data.pop_front())) {
                    *to = from;
                    count += 1;
                }
                return (Poll::Ready(Ok(count)), entry.paused && entry.has_room());
            }
            _ => entry.waker.register(waker),
        }
        (Poll::Pending, false)
    }

    /// Nobody waits for it any more. Whether the pump has to know.
    fn give_up(&mut self, ticket: Ticket) -> bool {
        let Some(entry) = self.entries.get_mut(usize::from(ticket.0)) else { return false };
        match entry.phase {
            Phase::Running => {
                entry.abandoned = true;
                return true;
            }
            Phase::Queued if entry.class == Class::Stop => entry.abandoned = true,
            Phase::Free | Phase::Queued | Phase::Ended(_) => entry.phase = Phase::Free,
        }
        false
    }
}

impl Desk {
    /// Orders a transfer with a node, whether or not it was ever heard. It begins, or is dropped, within three seconds.
    ///
    /// # Errors
    /// [`CanFailure::NotSent`]: there is no such CANopen bus, too many transfers are under way, or it writes too much.
    pub fn sdo(&self, now: Instant, order: SdoOrder<'_>) -> Result<SdoPending<'_>, CanFailure> {
        let ticket = self.with(|state| {
            let bus = state.can.bus(order.bus).ok_or(CanFailure::NotSent(Reason::Unmapped))?;
            let ticket = if bus.state.sends() {
                state.can.transfers.insert(now, &order)
            } else {
                Err(CanFailure::NotSent(Reason::LineDown))
            };
            if let (Err(_), Some(bus)) = (&ticket, state.can.bus(order.bus)) {
                bus.counted.not_sent();
            }
            ticket
        });
        let ticket = ticket?;
        self.work(Some(order.bus));
        Ok(SdoPending { desk: self, bus: order.bus, ticket: Some(ticket), end: Ok(()) })
    }
}

/// A transfer on its way. Dropped before its end it is given up: what waits for its turn is never sent, and what is under way
/// is aborted at the node; but not what stops an axis.
pub struct SdoPending<'d> {
    desk: &'d Desk,
    bus: u8,
    ticket: Option<Ticket>,
    end: Result<(), CanFailure>,
}

impl SdoPending<'_> {
    /// Waits for the next bytes of what is read, and copies as many as have room: 0 when that was all, and well. What came
    /// before an error is not to be used.
    ///
    /// # Errors
    /// Any [`CanFailure`], again and again.
    pub async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, CanFailure> {
        let Some(ticket) = self.ticket else { return self.end.map(|()| 0) };
        let result = poll_fn(|context| {
            let (poll, resumes) =
                self.desk.with(|state| state.can.transfers.collect(ticket, context.waker(), buffer));
            if resumes {
                self.desk.work(Some(self.bus));
            }
            poll
        })
        .await;
        match result {
            Ok(0) => self.ticket = None,
            Ok(_) => {}
            Err(failure) => (self.ticket, self.end) = (None, Err(failure)),
        }
        result
    }

    /// Waits until all is written.
    ///
    /// # Errors
    /// Any [`CanFailure`], again and again.
    pub async fn written(&mut self) -> Result<(), CanFailure> {
        self.read(&mut []).await.map(|_| ())
    }
}

impl Drop for SdoPending<'_> {
    fn drop(&mut self) {
        if let Some(ticket) = self.ticket
            && self.desk.with(|state| state.can.transfers.give_up(ticket))
        {
            self.desk.work(Some(self.bus));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A client in another thread made room while the rest of a block came: nobody told the manager to go on, and the client
    /// waited for ever.
    #[test]
    fn who_waits_for_room_is_told_to_go_on_whatever_came_meanwhile() {
        let (now, node) = (Instant::ZERO, NodeId::MIN);
        let mut transfers = Transfers::new();
        let transfer = SdoTransfer::Read { address: Address::new(0x2000, 0), block: true };
        let order = SdoOrder { seat: 0, bus: 0, node, class: Class::Free, transfer, timeout: None };
        let ticket = transfers.insert(now, &order).expect("a place");
        let mut turns = NodeTurns::NEW;
        let mut orders = Vec::<Order, 4>::new();
        let mut take = |transfers: &mut Transfers| {
            orders.clear();
            transfers.orders(now, 0, true, &mut turns, &[], &mut |order| orders.push(order).is_ok());
            orders.iter().any(|order| matches!(order, Order::Resume(_)))
        };
        assert!(!take(&mut transfers));
        while transfers.read(0, node, &[0; 7]) {}
        let mut place = [0; SDO_DATA];
        let (taken, resumes) = transfers.collect(ticket, Waker::noop(), &mut place);
        assert!(matches!(taken, Poll::Ready(Ok(1..))) && resumes);
        transfers.read(0, node, &[0; 7]);
        assert!(take(&mut transfers), "the manager goes on");
        assert!(!take(&mut transfers), "once");
    }
}
