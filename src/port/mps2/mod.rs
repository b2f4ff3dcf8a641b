//! QEMU's mps2-an500: a Cortex-M7 board that nobody has to own. docs/boards.md says what it does not model.
//!
//! Interrupt priorities are in `interrupt.rs`: in the same order as those of the Nucleo boards.

mod clock;
pub mod defaults;
mod executor;
mod fault;
mod flash;
mod host;
mod interrupt;
mod lan9118;
mod line;
mod lines;
mod log;
mod registers;
mod stack;

use embassy_executor::{SendSpawner, Spawner};
use embassy_net::Runner;

pub use executor::run;
pub use flash::Flash;
pub use line::Line;
pub use lines::{BadPort, Lines, check_line};

use crate::port::embedded::{self, Address, Network};
use lan9118::Lan9118;

/// TCP sequence numbers can be guessed here: there is no source of random numbers, and nobody to guess them.
const SEED: u64 = 0x7075_656E_7465;

/// What the board offers to the application.
pub struct Board {
    /// Spawns bus tasks, above those of the network.
    pub buses: SendSpawner,
    /// The serial lines.
    pub lines: Lines,
    /// Where the settings are kept.
    pub flash: Option<Flash>,
    /// The user button is held.
    pub button: bool,
}

impl Board {
    /// Starts clock and executors. Call it once, first of all.
    #[inline(never)]
    pub fn start(spawner: Spawner) -> Self {
        log::start();
        if let Some(mut core) = cortex_m::Peripherals::take() {
            interrupt::start(&mut core.NVIC);
        }
        clock::start();
        spawner.spawn(stack::watch().expect("the watch is started once"));
        Self {
            buses: executor::start(),
            lines: Lines::new(),
            flash: Flash::take(),
            button: registers::EMULATOR.read(0) == 1,
        }
    }

    /// Starts the network. Call it once.
    #[inline(never)]
    pub fn connect(&mut self, spawner: Spawner, address: Address) -> Network {
        let device = Lan9118::start();
        let mac = device.mac();
        let (stack, runner) = embedded::stack(device, address, SEED);
        spawner.spawn(network(runner).expect("the network task is started once"));
        Network { mac, stack }
    }
}

#[embassy_executor::task]
async fn network(mut runner: Runner<'static, Lan9118>) -> ! {
    runner.run().await
}
