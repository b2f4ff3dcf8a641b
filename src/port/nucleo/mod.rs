//! ST Nucleo-144 boards with Ethernet. docs/boards.md has the pins and the wiring.
//!
//! Interrupt priorities, the most urgent first: USARTs and the clock (0), bus tasks (6), Ethernet (8), then everything
//! else in thread mode.

pub mod defaults;
mod executor;
mod fault;
mod flash;
mod line;
mod lines;
mod log;
mod mac;
mod net;

#[cfg(feature = "nucleo-f767zi")]
#[path = "f767zi.rs"]
mod board;
#[cfg(feature = "nucleo-h753zi")]
#[path = "h753zi.rs"]
mod board;

use embassy_executor::{SendSpawner, Spawner};
use embassy_stm32::rng::Rng;
use embassy_stm32::uid;

pub use executor::run;
pub use flash::Flash;
pub use line::{Error as LineError, Line};
pub use lines::{BadPort, Lines, check_line};

use crate::port::embedded::{Address, Network};

/// What the board offers to the application.
pub struct Board {
    /// Spawns bus tasks, above everything in thread mode.
    pub buses: SendSpawner,
    /// The RS-485 lines.
    pub lines: Lines,
    /// Where the settings are kept; none where it is not as this image expects it.
    pub flash: Option<Flash>,
    /// The user button is held.
    pub button: bool,
    ethernet: Option<net::Parts>,
    seed: u64,
}

impl Board {
    /// Starts clocks and executors. Call it once, first of all.
    #[inline(never)]
    pub fn start(_: Spawner) -> Self {
        log::start();
        let p = embassy_stm32::init(board::config());
        board::enable_ethernet_memory();
        if let Some(mut core) = cortex_m::Peripherals::take() {
            // Flash has wait states. The data cache stays off: see net.rs.
            core.SCB.enable_icache();
        }
        let mut seed = [0; 8];
        Rng::new(p.RNG, board::RandomInterrupt).fill_bytes(&mut seed);
        Self {
            buses: executor::start(),
            lines: Lines {
                a: Some(line::a::Parts { usart: p.USART2, tx: p.PD5, rx: p.PD6, de: p.PD4 }),
                b: Some(line::b::Parts { usart: p.UART7, tx: p.PE8, rx: p.PE7, de: p.PE9 }),
            },
            flash: Flash::new(p.FLASH),
            button: false,
            ethernet: Some(net::Parts {
                eth: p.ETH,
                sma: p.ETH_SMA,
                ref_clk: p.PA1,
                mdio: p.PA2,
                mdc: p.PC1,
                crs_dv: p.PA7,
                rxd0: p.PC4,
                rxd1: p.PC5,
                tx_en: p.PG11,
                txd0: p.PG13,
                txd1: p.PB13,
            }),
            seed: u64::from_le_bytes(seed),
        }
    }

    /// Starts the network. Call it once.
    #[inline(never)]
    pub fn connect(&mut self, spawner: Spawner, address: Address) -> Network {
        let mac = mac::from_unique_id(&uid::uid());
        let ethernet = self.ethernet.take().expect("the network is started once");
        Network { mac, stack: net::start(spawner, ethernet, mac, address, self.seed) }
    }
}
