//! Watches the stack.

use embassy_time::Timer;

use crate::port::{Stack, stack};

/// Logs each new high-water mark. An overflow would not be noticed otherwise: below the stack QEMU has a region that
/// takes all writes and keeps none.
#[embassy_executor::task]
pub(super) async fn watch() -> ! {
    let mut known = 0;
    loop {
        if let Some(Stack { size, used }) = stack() {
            assert!(used < size, "the stack has overflowed");
            if used > known {
                known = used;
                log::info!("stack: {used} of {size} bytes used");
            }
        }
        Timer::after_secs(1).await;
    }
}
