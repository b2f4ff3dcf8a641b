//! QEMU's mps2-an500: a Cortex-M7 board that nobody has to own. docs/boards.md says what it does not model.
//!
//! Interrupt priorities are in `interrupt.rs`: in the same order as those of the Nucleo boards.

#[cfg(feature = "axis-module")]
mod axis;
#[cfg(feature = "axis-module")]
mod axis_board;
mod can;
mod clock;
mod executor;
mod flash;
mod host;
mod interrupt;
mod lan9118;
mod leds;
mod line;
mod lines;
mod log;
mod pacer;
mod registers;
#[cfg(feature = "axis-module")]
pub mod span;
mod stack;
#[cfg(feature = "axis-module")]
mod tick;
mod uart;
mod watchdog;

use embassy_executor::{SendSpawner, Spawner};
use embassy_net::Runner;

#[cfg(feature = "axis-module")]
pub use axis::Axis;
#[cfg(feature = "axis-module")]
pub use axis_board::{AxisBoard, Lamp};
pub use can::{Can, Cans, check_can};
pub use executor::run;
pub use flash::Flash;
pub use leds::Leds;
pub use line::Line;
pub use lines::{BadPort, Lines, check_line};
pub(super) use log::{last_words, log, logs};
#[cfg(feature = "axis-module")]
pub use tick::Tick;
pub use watchdog::Watchdog;

use crate::port::embedded::{Network, Patient, network, vital};
use lan9118::Lan9118;

/// TCP sequence numbers can be guessed here: there is no source of random numbers, and nobody to guess them.
const SEED: u64 = 0x7075_656E_7465;

/// What the board offers to the application.
pub struct Board {
    /// Spawns bus tasks, above those of the network.
    pub buses: SendSpawner,
    /// The serial lines.
    pub lines: Lines,
    /// The CAN buses.
    pub cans: Cans,
    /// Its LEDs.
    pub leds: Leds,
    /// The board's MAC address.
    pub mac: [u8; 6],
    /// The axes that may have moved when the board was reset, a bit each.
    pub moving: u32,
    /// The connection to the network.
    pub network: Network,
    /// Where the settings are kept.
    pub flash: Option<Flash>,
    /// The user button is held.
    pub button: bool,
    /// Another on each board and, as good as always, at each start: there is nothing better.
    pub seed: u64,
}

impl Board {
    /// Starts clock, network and executors. Call it once, first of all.
    #[inline(never)]
    pub fn start(spawner: Spawner) -> Self {
        let moving = vital::begin(None);
        log::start();
        if let Some(mut core) = cortex_m::Peripherals::take() {
            interrupt::start(&mut core.NVIC);
        }
        clock::start();
        let device = Lan9118::start();
        let mac = device.mac();
        let (network, runner) = network(device, SEED);
        spawner.spawn(network_task(runner).expect("the network task is started once"));
        spawner.spawn(stack::watch().expect("the watch is started once"));
        Self {
            buses: executor::start(),
            lines: Lines::new(),
            cans: Cans::new(),
            leds: Leds,
            mac,
            moving,
            network,
            flash: Flash::take(),
            button: registers::EMULATOR.read(registers::BUTTON) == 1,
            seed: seed(mac),
        }
    }
}

/// The MAC address, and the time that the start has taken on the computer that emulates the board.
fn seed(mac: [u8; 6]) -> u64 {
    let [a, b, c, d, e, f] = mac;
    u64::from_be_bytes([0, 0, a, b, c, d, e, f]) ^ embassy_time::Instant::now().as_ticks() << 32
}

/// What must not go on when the firmware fails: there is nothing, for the new start begins with a motor at rest.
pub(super) fn disarm() {}

/// Temperature of the chip in degrees Celsius, where it has a sensor.
pub fn temperature() -> Option<i16> {
    None
}

#[embassy_executor::task]
async fn network_task(mut runner: Runner<'static, Patient<Lan9118>>) -> ! {
    runner.run().await
}
