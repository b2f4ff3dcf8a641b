//! The process image: what is wanted of the axes of a cyclic bus, and what they are at.
//!
//! A cyclic bus says in every cycle what shall be, so nothing is queued for its axes: a command changes what is wanted,
//! and is confirmed by what the drive reports. Motion is wanted under a permit, and only as long as that holds and is
//! backed by a lease: whoever reads the image for the wire finds standstill from that moment on.

mod bus;
mod modules;
mod servos;

use core::future::poll_fn;
use core::task::Poll;

use embassy_futures::select::{Either, select};
use embassy_sync::waitqueue::MultiWakerRegistration;
use heapless::Vec;
use puente_drives::pid::Gains;
use puente_line::{Duration, Instant};
use puente_modules::Report;
use puente_modules::master::Statistics;

use super::lease::AxisLease;
use super::{Desk, Permit, State};
use crate::clock;
use crate::port::limits::AXES;

pub use bus::{BusImage, Kind};
pub use modules::{Modules, at_rest};
pub use servos::Servos;

/// What is wanted of an axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Wish {
    /// Nothing: it is only asked.
    #[default]
    Observe,
    /// No current, until it reports that it has none.
    Off,
    /// Standstill, whoever commands it, until it reports that. It puts nothing under current.
    Stop,
    /// Out of its fault, and no current: once. Another number is another attempt. A module knows it by [`Wish::Off`].
    Clear(u32),
    /// Current, and standstill.
    Hold,
    /// Motion, as long as the permit holds.
    Move(Motion, Permit),
}

/// How an axis is to move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// A module: to a position, ±[`MAX_SET_POINT`](puente_modules::MAX_SET_POINT) counts.
    Follow(i32),
    /// A CiA 402 drive.
    Servo(puente_servos::Motion),
}

impl Motion {
    /// What is wanted where its permit has ended.
    const fn ended(self) -> Wish {
        match self {
            Motion::Follow(_) => Wish::Hold,
            Motion::Servo(_) => Wish::Stop,
        }
    }

    /// Whether what answers `self` answers `next`, too.
    const fn goes_on(self, next: Motion) -> bool {
        matches!((self, next), (Motion::Follow(_), Motion::Follow(_)))
    }
}

/// What a drive has reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feedback {
    /// A module.
    Module(Report),
    /// A CiA 402 drive.
    Servo(puente_servos::Report),
}

impl Feedback {
    /// What is wanted after a `wish` which this answers; none where that has not come about yet.
    fn ends(&self, wish: Wish) -> Option<Wish> {
        match self {
            Feedback::Module(report) => modules::ends(report, wish),
            Feedback::Servo(report) => servos::ends(report, wish),
        }
    }

    /// That of a module.
    pub const fn module(self) -> Option<Report> {
        match self {
            Feedback::Module(report) => Some(report),
            Feedback::Servo(_) => None,
        }
    }

    /// That of a CiA 402 drive.
    pub const fn servo(self) -> Option<puente_servos::Report> {
        match self {
            Feedback::Module(_) => None,
            Feedback::Servo(report) => Some(report),
        }
    }
}

/// What an axis has reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// When.
    pub at: Instant,
    /// What.
    pub feedback: Feedback,
    /// It is the answer to what is wanted now, not to what was before.
    pub current: bool,
}

/// One axis of the image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// What is wanted.
    pub wish: Wish,
    /// The gains that go with it, of a module.
    pub gains: Gains,
    /// The last report.
    pub input: Option<Input>,
    /// The bus has seen what is wanted. A report from before is no answer to it.
    pub shown: bool,
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
    pub fn fresh(&self, now: Instant, within: Duration) -> Option<Feedback> {
        let input = self.input?;
        (now.since(input.at) <= within).then_some(input.feedback)
    }

    /// The report, where it is the answer to what is wanted now.
    pub fn answer(&self) -> Option<Feedback> {
        self.input.filter(|input| input.current).map(|input| input.feedback)
    }

    /// The report of a module, and when it came.
    pub fn module(&self) -> Option<(Instant, Report)> {
        let input = self.input?;
        Some((input.at, input.feedback.module()?))
    }

    /// The report of a CiA 402 drive, and when it came.
    pub fn servo(&self) -> Option<(Instant, puente_servos::Report)> {
        let input = self.input?;
        Some((input.at, input.feedback.servo()?))
    }

    /// What is to be off has no other wish before it is.
    fn want(&mut self, wish: Wish) {
        if self.wish == wish || self.wish == Wish::Off {
            return;
        }
        let goes_on = matches!((self.wish, wish), (Wish::Move(a, _), Wish::Move(b, _)) if a.goes_on(b));
        self.wish = wish;
        if !goes_on {
            self.unanswered();
        }
    }

    /// What was reported is no answer to what is wanted from now on.
    fn unanswered(&mut self) {
        self.shown = false;
        if let Some(input) = &mut self.input {
            input.current = false;
        }
    }

    /// Motion ends where its permit does.
    fn refresh(&mut self, leases: &[AxisLease], now: Instant) {
        if let Wish::Move(motion, permit) = self.wish
            && !permit.commands(leases, now)
        {
            self.want(motion.ended());
        }
    }

    /// Takes a report. Motion that has ended with it needs its permit no more.
    fn reported(&mut self, input: Input) -> Option<Permit> {
        let current = input.current && self.shown;
        self.input = Some(Input { current, ..input });
        let next = input.feedback.ends(self.wish).filter(|_| current)?;
        let before = core::mem::replace(&mut self.wish, next);
        // That the drive hears of it is yet to come.
        self.unanswered();
        match before {
            Wish::Move(_, permit) => Some(permit),
            _ => None,
        }
    }
}

impl Slot {
    fn wake(&mut self) {
        self.waiting.wake();
    }

    /// The bus has seen what is wanted.
    fn show(&mut self) {
        if !core::mem::replace(&mut self.view.shown, true) {
            self.wake();
        }
    }
}

impl Desk {
    /// An axis is on a cyclic bus, with these gains at first, where it is a module. Before anything else, after
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
            view.unanswered();
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

    /// Out of its fault, and no current, under a permit. The number is another one each time.
    pub fn reset(&self, now: Instant, permit: Permit, serial: u32) -> bool {
        self.want(now, permit, |view| view.want(Wish::Clear(serial)))
    }

    /// Motion, which has begun with it: from now on the holder of the lease must show life.
    pub fn go(&self, now: Instant, permit: Permit, motion: Motion) -> bool {
        self.on_slot(now, permit.axis(), |state| {
            permit.commands(&state.leases, now).then_some(())?;
            let slot = state.image.get_mut(usize::from(permit.axis()))?.as_mut()?;
            (slot.view.wish != Wish::Off).then_some(())?;
            slot.view.want(Wish::Move(motion, permit));
            state.leases.get_mut(usize::from(permit.axis()))?.run(now);
            Some(())
        })
        .is_some_and(|()| self.moving(now, permit))
    }

    /// Standstill of a module. Allowed to everyone.
    pub fn stop_cyclic(&self, now: Instant, axis: u8) {
        self.on_slot(now, axis, |state| {
            let view = &mut state.image.get_mut(usize::from(axis))?.as_mut()?.view;
            match view.wish {
                Wish::Observe => view.want(Wish::Stop),
                Wish::Move(motion, _) => view.want(motion.ended()),
                Wish::Stop | Wish::Hold | Wish::Off | Wish::Clear(_) => {}
            }
            Some(())
        });
    }

    /// A quick stop of a CiA 402 drive. Allowed to everyone.
    pub fn quick_stop(&self, now: Instant, axis: u8) {
        self.on_slot(now, axis, |state| {
            state.image.get_mut(usize::from(axis))?.as_mut()?.view.want(Wish::Stop);
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

#[cfg(test)]
mod tests;
