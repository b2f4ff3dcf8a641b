//! The image as its buses see it.

use core::marker::PhantomData;

use heapless::Vec;
use puente_line::Instant;

use super::{Feedback, Input, View, Wish, viewed};
use crate::bus::Image;
use crate::desk::{Bus, Cause, Desk};
use crate::port::limits::AXES;

/// A kind of drives, which share a bus.
pub trait Kind {
    /// What one is told.
    type Output;
    /// What one says.
    type Report;
    /// What is left of what was wanted of one.
    type Fall: Copy;

    /// What a drive is told.
    fn output(view: &View) -> Self::Output;
    /// What it has said.
    fn feedback(report: Self::Report) -> Feedback;
    /// What is wanted of one that fell; none where that does not change.
    fn fallen(wish: Wish, fall: Self::Fall) -> Option<Wish>;
    /// Why it fell.
    fn cause(view: &View, fall: Self::Fall) -> Cause;
}

/// The image as one bus sees it, with drives of one kind.
pub struct BusImage<'d, K> {
    /// The desk.
    pub desk: &'d Desk,
    /// Index of the bus.
    pub bus: u8,
    /// The axes of the bus, in its order.
    pub axes: Vec<u8, AXES>,
    /// What drives them.
    pub kind: PhantomData<K>,
}

impl<K> BusImage<'_, K> {
    pub(super) fn axis(&self, place: usize) -> Option<u8> {
        self.axes.get(place).copied()
    }

    pub(super) fn on_bus(&self, f: impl FnOnce(&mut Bus)) {
        self.desk.with(|state| state.buses.get_mut(usize::from(self.bus)).map(f));
    }
}

impl<K: Kind> Image for BusImage<'_, K> {
    type Output = K::Output;
    type Report = K::Report;
    type Fall = K::Fall;

    fn outputs(&self, now: Instant, mut set: impl FnMut(usize, K::Output)) -> Option<Instant> {
        self.desk.with(|state| {
            let mut first: Option<Instant> = None;
            for (place, axis) in self.axes.iter().enumerate() {
                let Some(slot) = viewed(state, now, *axis) else { continue };
                set(place, K::output(&slot.view));
                slot.show();
                if let Wish::Move(_, permit) = slot.view.wish {
                    let end = permit.end(&state.leases);
                    first = first.into_iter().chain(end).min();
                }
            }
            first
        })
    }

    fn reported(&self, now: Instant, place: usize, report: K::Report, current: bool) {
        let Some(axis) = self.axis(place) else { return };
        let input = Input { at: now, feedback: K::feedback(report), current };
        let over = self.desk.with(|state| {
            let slot = viewed(state, now, axis)?;
            let over = slot.view.reported(input);
            slot.wake();
            // In the same moment: whoever sees the end may move it again, under a lease of its own.
            let permit = over?;
            state.leases.get_mut(usize::from(axis))?.end(permit);
            Some(())
        });
        if over.is_some() {
            self.desk.lease_ended(axis);
        }
    }

    fn fell(&self, now: Instant, place: usize, fall: K::Fall) {
        let Some(axis) = self.axis(place) else { return };
        let cause = self.desk.on_slot(now, axis, |state| {
            let view = &mut state.image.get_mut(usize::from(axis))?.as_mut()?.view;
            if let Some(wish) = K::fallen(view.wish, fall) {
                view.want(wish);
            }
            Some(K::cause(view, fall))
        });
        if let Some(cause) = cause {
            self.desk.fallen(now, axis, cause);
        }
    }

    async fn changed(&self) {
        match self.desk.work.get(usize::from(self.bus)) {
            Some(signal) => signal.wait().await,
            None => core::future::pending().await,
        }
    }

    fn line(&self, down: bool) {
        self.on_bus(|bus| bus.line_down = down);
    }

    fn alive(&self, until: Instant) {
        self.on_bus(|bus| bus.alive_until = Some(until));
    }
}
