//! The process image: what is wanted of the axes of a cyclic bus, and what they are at.
//!
//! A cyclic bus says in every cycle what shall be, so nothing is queued for its axes: a command changes what is wanted,
//! and is confirmed by what the drive reports. Motion is wanted under a permit, and only as long as that holds and is
//! backed by a lease: whoever reads the image for the wire finds standstill from that moment on.

use core::future::poll_fn;
use core::task::Poll;

use embassy_futures::select::{Either, select};
use embassy_sync::waitqueue::MultiWakerRegistration;
use heapless::Vec;
use puente_drives::pid::{Event, Gains, State as Module};
use puente_line::{Duration, Instant};
use puente_modules::master::{Output, Statistics};
use puente_modules::{Control, MAX_SET_POINT, Report};

use super::lease::AxisLease;
use super::{Cause, Desk, Permit, State};
use crate::bus::Image;
use crate::clock;
use crate::port::limits::AXES;

/// What is wanted of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Wish {
    /// Nothing: it is only asked.
    #[default]
    Observe,
    /// No current, until it reports that it has none.
    Off,
    /// Standstill, whoever commands it, until it reports that. It puts nothing under current: it says no gains, without
    /// which no module enables itself.
    Stop,
    /// Current, and standstill.
    Hold,
    /// Going to a position, in counts, as long as the permit holds.
    Follow(i32, Permit),
}

/// What an axis has reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// When.
    pub at: Instant,
    /// What.
    pub report: Report,
    /// It is the answer to what is wanted now, not to what was before.
    pub current: bool,
}

/// One axis of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// What is wanted.
    pub wish: Wish,
    /// The gains that go with it.
    pub gains: Gains,
    /// The last report.
    pub input: Option<Input>,
}

pub(super) struct Slot {
    bus: u8,
    view: View,
    waiting: MultiWakerRegistration<2>,
}

/// The image of all axes, in their order; none where an axis is on a bus that is not cyclic.
pub(super) type Slots = Vec<Option<Slot>, AXES>;

impl View {
    /// The report, where it is not older than this.
    pub fn fresh(&self, now: Instant, within: Duration) -> Option<Report> {
        let input = self.input?;
        (now.since(input.at) <= within).then_some(input.report)
    }

    /// The report, where it is the answer to what is wanted now.
    pub fn answer(&self) -> Option<Report> {
        self.input.filter(|input| input.current).map(|input| input.report)
    }

    /// What is to be off has no other wish before it is.
    fn want(&mut self, wish: Wish) {
        if self.wish == wish || self.wish == Wish::Off {
            return;
        }
        let goes_on = matches!((self.wish, wish), (Wish::Follow(..), Wish::Follow(..)));
        self.wish = wish;
        if let Some(input) = &mut self.input {
            input.current &= goes_on;
        }
    }

    fn output(&self) -> Output {
        let here = self.input.map_or(0, |input| input.report.position);
        let here = here.clamp(-MAX_SET_POINT, MAX_SET_POINT);
        let (control, gains, set_point) = match self.wish {
            Wish::Observe => (Control::Observe, self.gains, here),
            Wish::Off => (Control::Off, self.gains, here),
            Wish::Stop => (Control::Hold, Gains::default(), here),
            Wish::Hold => (Control::Hold, self.gains, here),
            Wish::Follow(set_point, _) => (Control::Follow, self.gains, set_point),
        };
        Output { control, gains, set_point }
    }

    /// Motion ends where its permit does.
    fn refresh(&mut self, leases: &[AxisLease], now: Instant) {
        if let Wish::Follow(_, permit) = self.wish
            && !permit.commands(leases, now)
        {
            self.want(Wish::Hold);
        }
    }

    fn reported(&mut self, input: Input) {
        self.input = Some(input);
        let done = match (self.wish, input.report.state) {
            (Wish::Off, state) => state == Module::Disabled,
            (Wish::Stop, state) => at_rest(state),
            _ => false,
        };
        if input.current && done {
            self.wish = Wish::Observe;
            // That the module hears of it is yet to come.
            self.input = Some(Input { current: false, ..input });
        }
    }
}

/// Whether a module in this state follows no set-point.
pub fn at_rest(state: Module) -> bool {
    matches!(state, Module::Disabled | Module::Held | Module::Fault(_))
}

impl Slot {
    fn wake(&mut self) {
        self.waiting.wake();
    }
}

impl Desk {
    /// An axis is on a cyclic bus, with these gains at first. Before anything else, after
    /// [`configure`](Desk::configure).
    pub fn add_cyclic(&self, axis: u8, bus: u8, gains: Gains) {
        self.with(|state| {
            let slot =
                Slot { bus, view: View { gains, ..View::default() }, waiting: MultiWakerRegistration::new() };
            if let Some(place) = state.image.get_mut(usize::from(axis)) {
                *place = Some(slot);
            }
        });
    }

    /// An axis of the image; nothing is wanted of one that is not in it.
    pub fn view(&self, now: Instant, axis: u8) -> View {
        self.with(|state| viewed(state, now, axis).map_or(View::default(), |slot| slot.view))
    }

    /// Changes what is wanted where the permit holds; false where it does not, and where the axis is in no image.
    fn want(&self, now: Instant, permit: Permit, f: impl FnOnce(&mut View)) -> bool {
        self.on_slot(now, permit.axis(), |state| {
            let valid = permit.valid(&state.leases, now);
            let slot = state.image.get_mut(usize::from(permit.axis()))?.as_mut()?;
            valid.then(|| f(&mut slot.view))
        })
        .is_some()
    }

    /// Gains, from now on.
    pub fn set_gains(&self, now: Instant, permit: Permit, gains: Gains) -> bool {
        self.want(now, permit, |view| {
            view.gains = gains;
            if let Some(input) = &mut view.input {
                input.current = false;
            }
        })
    }

    /// Current, and standstill.
    pub fn hold(&self, now: Instant, permit: Permit) -> bool {
        self.want(now, permit, |view| view.want(Wish::Hold))
    }

    /// No current, under a permit.
    pub fn release_current(&self, now: Instant, permit: Permit) -> bool {
        self.want(now, permit, |view| view.want(Wish::Off))
    }

    /// Going to a position, ±[`MAX_SET_POINT`] counts. Motion has begun with it: from now on the holder of the lease must
    /// show life.
    pub fn follow(&self, now: Instant, permit: Permit, set_point: i32) -> bool {
        self.on_slot(now, permit.axis(), |state| {
            permit.commands(&state.leases, now).then_some(())?;
            let slot = state.image.get_mut(usize::from(permit.axis()))?.as_mut()?;
            (slot.view.wish != Wish::Off).then_some(())?;
            slot.view.want(Wish::Follow(set_point, permit));
            state.leases.get_mut(usize::from(permit.axis()))?.run(now);
            Some(())
        })
        .is_some()
    }

    /// Standstill. Allowed to everyone.
    pub fn stop_cyclic(&self, now: Instant, axis: u8) {
        self.on_slot(now, axis, |state| {
            let view = &mut state.image.get_mut(usize::from(axis))?.as_mut()?.view;
            match view.wish {
                Wish::Observe => view.want(Wish::Stop),
                Wish::Follow(..) => view.want(Wish::Hold),
                Wish::Stop | Wish::Hold | Wish::Off => {}
            }
            Some(())
        });
    }

    /// No current. Allowed to everyone.
    pub fn switch_off(&self, now: Instant, axis: u8) {
        self.on_slot(now, axis, |state| {
            state.image.get_mut(usize::from(axis))?.as_mut()?.view.want(Wish::Off);
            Some(())
        });
    }

    /// No current is wanted any more of an axis that did not take it.
    pub fn give_up(&self, now: Instant, axis: u8) {
        self.on_slot(now, axis, |state| {
            let view = &mut state.image.get_mut(usize::from(axis))?.as_mut()?.view;
            (view.wish == Wish::Hold).then(|| view.want(Wish::Observe))
        });
    }

    /// Nothing: the holder of the lease commands the axis past the image.
    pub fn observe(&self, now: Instant, permit: Permit) {
        self.want(now, permit, |view| view.want(Wish::Observe));
    }

    /// The pump hears of a change, and so does who waits for it.
    fn on_slot<T>(&self, now: Instant, axis: u8, f: impl FnOnce(&mut State) -> Option<T>) -> Option<T> {
        let (result, bus) = self.with(|state| {
            viewed(state, now, axis);
            let result = f(state);
            let slot = state.image.get_mut(usize::from(axis)).and_then(Option::as_mut);
            let bus = slot.map(|slot| {
                slot.wake();
                slot.bus
            });
            (result, bus)
        });
        if let Some(signal) = bus.and_then(|bus| self.work.get(usize::from(bus))) {
            signal.signal(());
        }
        result
    }

    /// Waits until `f` makes something of an axis; none where that takes longer than `within`.
    pub async fn until<T>(
        &self,
        axis: u8,
        within: Duration,
        mut f: impl FnMut(&View) -> Option<T>,
    ) -> Option<T> {
        let end = clock::now() + within;
        let found = poll_fn(|context| {
            self.with(|state| {
                let Some(slot) = viewed(state, clock::now(), axis) else { return Poll::Pending };
                match f(&slot.view) {
                    Some(found) => Poll::Ready(found),
                    None => {
                        slot.waiting.register(context.waker());
                        Poll::Pending
                    }
                }
            })
        });
        match select(found, clock::at(Some(end))).await {
            Either::First(found) => Some(found),
            Either::Second(()) => None,
        }
    }

    /// What a cyclic bus has counted.
    pub fn cycles(&self, bus: u8) -> Option<Statistics> {
        self.with(|state| state.buses.get(usize::from(bus)).map(|bus| bus.cycles))
    }

    /// Whether the port of a cyclic bus has failed.
    pub fn line_down(&self, bus: u8) -> bool {
        self.with(|state| state.buses.get(usize::from(bus)).is_some_and(|bus| bus.line_down))
    }
}

/// An axis of the image as it is now.
fn viewed(state: &mut State, now: Instant, axis: u8) -> Option<&mut Slot> {
    let slot = state.image.get_mut(usize::from(axis))?.as_mut()?;
    slot.view.refresh(&state.leases, now);
    Some(slot)
}

/// The image as one bus sees it.
pub struct BusImage<'d> {
    /// The desk.
    pub desk: &'d Desk,
    /// Index of the bus.
    pub bus: u8,
    /// The axes of the bus, in its order.
    pub axes: Vec<u8, AXES>,
}

impl BusImage<'_> {
    fn axis(&self, place: usize) -> Option<u8> {
        self.axes.get(place).copied()
    }

    fn on_bus(&self, f: impl FnOnce(&mut super::Bus)) {
        self.desk.with(|state| state.buses.get_mut(usize::from(self.bus)).map(f));
    }
}

impl Image for BusImage<'_> {
    fn outputs(&self, now: Instant, mut set: impl FnMut(usize, Output)) {
        self.desk.with(|state| {
            for (place, axis) in self.axes.iter().enumerate() {
                if let Some(slot) = viewed(state, now, *axis) {
                    set(place, slot.view.output());
                }
            }
        });
    }

    fn reported(&self, now: Instant, place: usize, report: Report, current: bool) {
        let Some(axis) = self.axis(place) else { return };
        self.desk.with(|state| {
            if let Some(slot) = viewed(state, now, axis) {
                slot.view.reported(Input { at: now, report, current });
                slot.wake();
            }
        });
    }

    fn happened(&self, place: usize, event: Event) {
        if let (Some(axis), Event::Fault(cause)) = (self.axis(place), event) {
            log::warn!("axis {} of the settings: {cause}", axis + 1);
        }
    }

    fn fell(&self, now: Instant, place: usize, to: Control) {
        let Some(axis) = self.axis(place) else { return };
        let fault = self.desk.on_slot(now, axis, |state| {
            let view = &mut state.image.get_mut(usize::from(axis))?.as_mut()?.view;
            match (view.wish, to) {
                (Wish::Follow(..), Control::Hold) => view.want(Wish::Hold),
                (Wish::Follow(..) | Wish::Hold, Control::Observe) => view.want(Wish::Observe),
                // It is not wanted any more in any case.
                _ => {}
            }
            Some(matches!(view.input?.report.state, Module::Fault(_)))
        });
        let cause = if fault == Some(true) { Cause::DriveFault } else { Cause::Stopped };
        self.desk.fallen(now, axis, cause);
    }

    async fn changed(&self) {
        match self.desk.work.get(usize::from(self.bus)) {
            Some(signal) => signal.wait().await,
            None => core::future::pending().await,
        }
    }

    fn counted(&self, statistics: Statistics) {
        self.on_bus(|bus| bus.cycles = statistics);
    }

    fn line(&self, down: bool) {
        self.on_bus(|bus| bus.line_down = down);
    }

    fn alive(&self, until: Instant) {
        self.on_bus(|bus| bus.alive_until = Some(until));
    }
}

#[cfg(test)]
mod tests;
