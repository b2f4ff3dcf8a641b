//! QEMU's mps2-an500: a Cortex-M7 board that nobody has to own. docs/boards.md says what it does not model.
//!
//! Interrupt priorities are in `interrupt.rs`: in the same order as those of the Nucleo boards.

mod clock;
mod executor;
mod fault;
mod host;
mod interrupt;
mod lan9118;
mod leds;
mod line;
mod lines;
mod log;
mod pacer;
mod registers;
mod stack;

use embassy_executor::{SendSpawner, Spawner};
use embassy_net::{Runner, Stack};

pub use executor::run;
pub use leds::Leds;
pub use line::Line;
pub use lines::{BadPort, Lines};

use crate::port::embedded::{self, Address, Network, Place, Ports, limits, places};
use lan9118::Lan9118;

/// TCP sequence numbers can be guessed here: there is no source of random numbers, and nobody to guess them.
const SEED: u64 = 0x7075_656E_7465;

/// What the board offers to the application.
pub struct Board {
    /// Spawns bus tasks, above those of the network.
    pub buses: SendSpawner,
    /// The serial lines.
    pub lines: Lines,
    /// Its LEDs.
    pub leds: Leds,
    /// The board's MAC address.
    pub mac: [u8; 6],
    stack: Stack<'static>,
}

impl Board {
    /// 10.0.2.15/24, where QEMU's user network expects its guest.
    pub const ADDRESS: Address = Address { ip: [10, 0, 2, 15], prefix: 24, gateway: Some([10, 0, 2, 2]) };

    /// Starts clock, network and executors. Call it once, first of all.
    #[inline(never)]
    pub fn start(spawner: Spawner, address: Address) -> Self {
        log::start();
        if let Some(mut core) = cortex_m::Peripherals::take() {
            interrupt::start(&mut core.NVIC);
        }
        clock::start();
        let device = Lan9118::start();
        let mac = device.mac();
        let (stack, runner) = embedded::stack(device, address, SEED);
        spawner.spawn(network(runner).expect("the network task is started once"));
        spawner.spawn(stack::watch().expect("the watch is started once"));
        #[cfg(feature = "test-hooks")]
        spawner.spawn(embedded::echo::serve(stack).expect("the echo is started once"));
        Self { buses: executor::start(), lines: Lines::new(), leds: Leds, mac, stack }
    }

    /// The connection to the network.
    pub fn network(&self) -> Network {
        Network(self.stack)
    }

    /// The places for clients on the main and the Modbus/TCP port. Call it once.
    pub fn places(&self, main: u16, modbus: u16) -> [Place; limits::SLOTS] {
        places(self.stack, Ports { main, modbus })
    }
}

#[embassy_executor::task]
async fn network(mut runner: Runner<'static, Lan9118>) -> ! {
    runner.run().await
}
