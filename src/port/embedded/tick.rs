//! What the loop's interrupt calls.

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

type Step = Cell<Option<fn()>>;

static STEP: Mutex<CriticalSectionRawMutex, Step> = Mutex::new(Cell::new(None));

/// Sets what each tick calls.
pub(in crate::port) fn set(step: fn()) {
    STEP.lock(|place| place.set(Some(step)));
}

/// To be called by the interrupt.
pub(in crate::port) fn ticked() {
    if let Some(step) = STEP.lock(Cell::get) {
        step();
    }
}
