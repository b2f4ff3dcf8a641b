//! A new start.

use super::vital;
use crate::port::record::Reset;

/// Starts the gateway anew, by a reset of the whole chip.
pub fn restart() -> ! {
    vital::reason(Reset::Software);
    cortex_m::peripheral::SCB::sys_reset()
}
