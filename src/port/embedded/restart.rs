//! A new start.

/// Starts the gateway anew, by a reset of the whole chip.
pub fn restart() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}
