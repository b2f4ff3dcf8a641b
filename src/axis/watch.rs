//! The watchman of an axis: who stops it when its commander is gone.

use puente_line::Duration;

use super::{Axes, Commander};
use crate::clock;
use crate::desk::{Cause, Holder};

/// So many stops without confirmation are told, and repeated soon; then more slowly.
const STOP_ATTEMPTS: u32 = 10;

impl Axes {
    /// Stops the axis whenever its lease is lost, and repeats that until the drive confirms. One task an axis.
    pub async fn watch(&self, id: u8) -> ! {
        let by = Commander { seat: crate::port::limits::SLOTS as u8 + id, holder: Holder::Gateway };
        let name = self.get(id).map_or("?", |axis| axis.name.as_str());
        loop {
            let cause = self.desk.owed(id).await;
            log::warn!("axis {name}: {}, stopping it", cause.name());
            let mut failed = 0;
            while self.desk.owes(id) {
                let begun = clock::now();
                let Err(error) = self.stop(id, by).await else { break };
                failed += 1;
                if failed <= STOP_ATTEMPTS {
                    log::error!("axis {name}: stop attempt {failed}: {error}");
                }
                if failed == STOP_ATTEMPTS {
                    self.desk.stop_unconfirmed(clock::now(), id);
                    log::error!("axis {name}: {}, still trying", Cause::StopUnconfirmed.name());
                }
                let pause = stop_pause(clock::now().since(begun), failed);
                embassy_time::Timer::after_micros(puente_line::micros(pause)).await;
            }
        }
    }
}

/// Time between two stops that `took` so long each, after so many that failed. The other drives of the bus have half of
/// the line at first, and later as much as they have beside any dead drive.
fn stop_pause(took: Duration, failed: u32) -> Duration {
    if failed < STOP_ATTEMPTS {
        took.max(Duration::from_millis(100))
    } else {
        took.saturating_mul(9).clamp(Duration::from_secs(1), Duration::from_secs(10))
    }
}
