//! ST Nucleo-144 boards with Ethernet. docs/boards.md has the pins and the wiring.
//!
//! Interrupt priorities, the most urgent first: USARTs and the clock (0), bus tasks (6), Ethernet (8), then everything
//! else in thread mode.

mod executor;
mod line;
mod lines;
mod log;
mod mac;
mod net;
mod reset;
mod watchdog;

#[cfg(feature = "nucleo-f767zi")]
#[path = "f767zi.rs"]
mod board;
#[cfg(feature = "nucleo-h753zi")]
#[path = "h753zi.rs"]
mod board;

use embassy_executor::{SendSpawner, Spawner};
use embassy_net::Stack;
use embassy_stm32::rng::Rng;
use embassy_stm32::uid;

pub use executor::run;
pub use line::{Error as LineError, Line};
pub use lines::{BadPort, Lines};
pub(super) use log::{last_words, log, logs};
pub use watchdog::Watchdog;

use crate::port::embedded::{Address, Place, Ports, join, limits, places, vital};

/// What the board offers to the application.
pub struct Board {
    /// Spawns bus tasks, above everything in thread mode.
    pub buses: SendSpawner,
    /// The RS-485 lines.
    pub lines: Lines,
    /// The board's MAC address.
    pub mac: [u8; 6],
    /// The axes that may have moved when the board was reset, a bit each.
    pub moving: u32,
    stack: Stack<'static>,
}

impl Board {
    /// Starts clocks, network and executors. Call it once, first of all.
    #[inline(never)]
    pub fn start(spawner: Spawner) -> Self {
        let moving = vital::begin(Some(reset::cause()));
        log::start();
        let p = embassy_stm32::init(board::config());
        board::enable_ethernet_memory();
        if let Some(mut core) = cortex_m::Peripherals::take() {
            // Flash has wait states. The data cache stays off: see net.rs.
            core.SCB.enable_icache();
        }
        let mut seed = [0; 8];
        Rng::new(p.RNG, board::RandomInterrupt).fill_bytes(&mut seed);
        let mac = mac::from_unique_id(&uid::uid());
        let ethernet = net::Parts {
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
        };
        Self {
            buses: executor::start(),
            lines: Lines {
                a: Some(line::a::Parts { usart: p.USART2, tx: p.PD5, rx: p.PD6, de: p.PD4 }),
                b: Some(line::b::Parts { usart: p.UART7, tx: p.PE8, rx: p.PE7, de: p.PE9 }),
            },
            mac,
            moving,
            stack: net::start(spawner, ethernet, mac, u64::from_le_bytes(seed)),
        }
    }

    /// Gets an address, and makes itself known with these TCP ports. Call it once.
    pub fn join(&self, spawner: Spawner, address: Address, main: u16, modbus: u16) {
        let join = join(self.stack, address, Ports { main, modbus });
        spawner.spawn(join.expect("the network is joined once"));
    }

    /// The places for clients on the main and the Modbus/TCP port. Call it once.
    pub fn places(&self, main: u16, modbus: u16) -> [Place; limits::SLOTS] {
        places(self.stack, Ports { main, modbus })
    }
}

/// Temperature of the chip in degrees Celsius, where it has a sensor.
pub fn temperature() -> Option<i16> {
    None
}
