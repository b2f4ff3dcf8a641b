//! Watches the stack.

use embassy_time::Timer;

use crate::port::embedded::stack::painted;
use crate::port::{Stack, stack};

/// More words than calls leave unwritten at a stretch.
const LOOK: usize = 256;

/// Logs each new high-water mark. An overflow would not be noticed otherwise: below the stack QEMU has a region that
/// takes all writes and keeps none.
#[embassy_executor::task]
pub(super) async fn watch() -> ! {
    // Words that were free so far; of them only the next ones are looked at each time.
    let mut free = usize::MAX;
    loop {
        let written = free == usize::MAX || (free.saturating_sub(LOOK)..free).any(|word| !painted(word));
        if written && let Some(Stack { size, used }) = stack() {
            assert!(used < size, "the stack has overflowed");
            free = (size - used) / size_of::<u32>();
            log::info!("stack: {used} of {size} bytes used");
        }
        Timer::after_secs(1).await;
    }
}
