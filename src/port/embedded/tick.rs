//! What the loop's interrupt does.

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

use crate::port::Step;

type Place = Cell<Option<&'static dyn Step>>;

static PLACE: Mutex<CriticalSectionRawMutex, Place> = Mutex::new(Cell::new(None));

/// Sets what each tick does.
pub(in crate::port) fn set(step: &'static dyn Step) {
    PLACE.lock(|place| place.set(Some(step)));
}

/// To be called by the interrupt.
pub(in crate::port) fn ticked() {
    if let Some(step) = PLACE.lock(Cell::get) {
        step.step();
    }
}
