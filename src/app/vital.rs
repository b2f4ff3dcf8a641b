//! Feeds the watchdog while the gateway lives.

use embassy_time::{Duration, Timer};

use crate::clock;
use crate::front::Gateway;
use crate::port::{self, Watchdog};

/// How often the watchdog is fed: a fraction of its period, so that a busy network does not look like a hanging one.
const PAUSE: Duration = Duration::from_millis(250);

/// Feeds it as long as every bus shows life. That this runs at all shows that the clients' executor turns, and that no
/// bus keeps the processor from it. A task of a client that waits is none that hangs: each of its waits has an end, or
/// is for the client.
#[embassy_executor::task]
pub async fn feeder_task(gateway: &'static Gateway) -> ! {
    let mut watchdog = Watchdog::start();
    let hung = loop {
        if let Some(bus) = gateway.desk.hung(clock::now()) {
            break bus;
        }
        watchdog.feed();
        Timer::after(PAUSE).await;
    };
    let name = gateway.settings.buses.get(usize::from(hung)).map_or("?", |bus| bus.name.as_str());
    port::hung(format_args!("bus {name} makes no progress"));
    core::future::pending().await
}
