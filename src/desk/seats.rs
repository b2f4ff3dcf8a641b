//! Who is to be woken: the client of a seat, which waits for one thing or for several at once in its one task.

use core::task::Waker;

use embassy_sync::waitqueue::WakerRegistration;

use crate::port::limits::SLOTS;

pub(super) struct Seats([WakerRegistration; SLOTS]);

impl Seats {
    pub(super) const fn new() -> Self {
        Self([const { WakerRegistration::new() }; SLOTS])
    }

    pub(super) fn wake(&mut self, seat: u8) {
        if let Some(waker) = self.0.get_mut(usize::from(seat)) {
            waker.wake();
        }
    }

    pub(super) fn wake_all(&mut self) {
        self.0.iter_mut().for_each(WakerRegistration::wake);
    }

    pub(super) fn register(&mut self, seat: u8, waker: &Waker) {
        if let Some(place) = self.0.get_mut(usize::from(seat)) {
            place.register(waker);
        }
    }
}
