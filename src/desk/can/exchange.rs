//! The desk as the pump of a CANopen bus sees it.

use puente_canopen::emcy::Emergency;
use puente_canopen::manager::{BusEvent, Counters, Event};
use puente_canopen::{Frame, NodeId, lss, monitor, sdo};
use puente_line::Instant;

use super::{Bus, Origin, What};
use crate::bus::canopen::{Exchange, Order, Room};
use crate::bus::{Taken, Undelivered};
use crate::desk::{Desk, State};
use crate::port::{CanCounters, CanState};

/// The desk as the pump of a CANopen bus sees it.
pub struct CanBus<'d> {
    desk: &'d Desk,
    bus: u8,
    /// Its place among the CANopen buses.
    place: usize,
}

impl<'d> CanBus<'d> {
    /// A bus; none where it has not been [added](Desk::add_can).
    pub fn new(desk: &'d Desk, bus: u8) -> Option<Self> {
        let place = desk.with(|state| state.can.place(bus))?;
        Some(Self { desk, bus, place })
    }

    /// Where its manager lives.
    pub fn room(&self) -> Option<&'static Room> {
        self.desk.with(|state| state.can.room(self.bus))
    }

    fn on_bus(&self, f: impl FnOnce(&mut Bus)) {
        self.desk.with(|state| state.can.buses.get_mut(self.place).map(f));
    }

    fn keep(&self, now: Instant, what: What) {
        self.desk.with(|State { can, seats, .. }| can.keep(seats, self.place, now, what));
    }
}

impl Exchange for CanBus<'_> {
    fn orders(&self, now: Instant, mut take: impl FnMut(Order) -> bool) -> Option<Instant> {
        self.desk.with(|State { can, leases, .. }| {
            let bus = can.buses.get_mut(self.place)?;
            while let Some((command, node)) = bus.commands.front().copied() {
                if bus.state.sends() && !take(Order::Nmt(command, node)) {
                    break;
                }
                bus.commands.pop_front();
            }
            let (command, timeout) = bus.lss;
            if bus.lss_place.take(leases, now).is_some() && !take(Order::Lss(command, timeout)) {
                // Its turn comes when the one before it has ended, which is told.
                bus.lss_place.put_back();
            }
            if bus.lss_place.is_abandoned() {
                take(Order::CancelLss);
            }
            let turns = can.turns.get_mut(self.place)?;
            let up = bus.state.sends();
            let (wake, not_sent) = can.transfers.orders(now, self.bus, up, turns, leases, &mut take);
            (0..not_sent).for_each(|_| bus.counted.not_sent());
            wake
        })
    }

    fn outgoing(&self, now: Instant, take: impl FnOnce(&Frame) -> Taken) {
        self.desk.with(|State { can, leases, seats, .. }| {
            let Some(bus) = can.buses.get_mut(self.place) else { return };
            let Some(may) = bus.frames.take(leases, now) else { return };
            match if may { take(&bus.frame) } else { Taken::Never(Undelivered::Stopped) } {
                Taken::Yes => {}
                Taken::NotYet => bus.frames.give_back(seats),
                Taken::Never(why) => {
                    bus.counted.undelivered();
                    bus.frames.end(seats, Err(why));
                }
            }
        });
    }

    fn posted(&self, now: Instant, outcome: Result<(), Undelivered>) {
        self.desk.with(|State { can, seats, .. }| {
            let Some(bus) = can.buses.get_mut(self.place) else { return };
            let (sender, frame) = (bus.frames.sender(), bus.frame);
            bus.frames.end(seats, outcome);
            if outcome.is_err() {
                bus.counted.undelivered();
                return;
            }
            bus.counted.sent(now, &frame);
            let origin = sender.map_or(Origin::Gateway, Origin::Client);
            can.keep(seats, self.place, now, What::Frame { frame, origin });
        });
    }

    fn fetch(&self, node: NodeId, offset: u32, count: usize, f: impl FnOnce(&[u8])) {
        self.desk.with(|state| state.can.transfers.fetch(self.bus, node, offset, count, f));
    }

    fn read(&self, node: NodeId, bytes: &[u8]) -> bool {
        self.desk.with(|state| state.can.transfers.read(self.bus, node, bytes))
    }

    fn done(&self, _: Instant, node: NodeId, end: Result<sdo::Outcome, sdo::Failure>) {
        self.desk.with(|state| state.can.transfers.done(self.bus, node, end.map(|_| ())));
    }

    fn lss(&self, end: Result<lss::Outcome, lss::Failure>) {
        self.desk.with(|State { can, seats, .. }| {
            if let Some(bus) = can.buses.get_mut(self.place) {
                bus.lss_place.end(seats, end);
            }
        });
    }

    fn heard(&self, now: Instant, frame: &Frame) {
        self.on_bus(|bus| bus.counted.received(now, frame));
        self.keep(now, What::Frame { frame: *frame, origin: Origin::Bus });
    }

    fn sent(&self, now: Instant, frame: &Frame) {
        self.on_bus(|bus| bus.counted.sent(now, frame));
        self.keep(now, What::Frame { frame: *frame, origin: Origin::Gateway });
    }

    fn happened(&self, now: Instant, node: NodeId, event: Event) {
        log::log!(level(&event), "bus {}: node {node}: {event}", self.bus + 1);
        self.keep(now, What::Node(node, event));
    }

    fn happened_on_bus(&self, now: Instant, event: BusEvent) {
        log::warn!("bus {}: {event}", self.bus + 1);
        self.keep(now, What::Bus(event));
    }

    fn state(&self, now: Instant, state: CanState) {
        self.on_bus(|bus| bus.state = state);
        self.keep(now, What::State(state));
    }

    fn counted(&self, port: CanCounters, manager: Counters) {
        self.on_bus(|bus| bus.counted.counters(port, manager));
    }
}

/// What somebody has to look after is a warning.
const fn level(event: &Event) -> log::Level {
    match event {
        Event::Booted => log::Level::Info,
        Event::Monitor(monitor::Event::Lost(_) | monitor::Event::Toggle) => log::Level::Warn,
        Event::Monitor(_) => log::Level::Info,
        Event::Emergency(emergency) if emergency.code == Emergency::RESET => log::Level::Info,
        Event::Emergency(_) | Event::NotBooted(_) | Event::Missing => log::Level::Warn,
        Event::Declined(..) | Event::DuplicateId(_) => log::Level::Warn,
    }
}
