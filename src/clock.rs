//! The one clock of the application: embassy-time, as the protocols' [`Instant`].

use embassy_time::Timer;
use puente_line::Instant;

/// The present moment.
pub fn now() -> Instant {
    Instant::from_micros(embassy_time::Instant::now().as_micros())
}

/// Waits until `moment`; for ever where there is none.
pub async fn at(moment: Option<Instant>) {
    match moment {
        Some(moment) => Timer::at(embassy_time::Instant::from_micros(moment.as_micros())).await,
        None => core::future::pending().await,
    }
}
