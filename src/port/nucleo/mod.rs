//! ST Nucleo-144 boards with Ethernet. docs/boards.md has the pins and the wiring.
//!
//! Interrupt priorities, the most urgent first: USARTs and the clock (0), bus tasks (6), Ethernet (8), then everything
//! else in thread mode.

mod calibration;
mod can;
mod executor;
mod fault;
mod leds;
mod line;
mod lines;
mod log;
mod mac;
mod net;
mod temperature;

#[cfg(feature = "nucleo-f429zi")]
#[path = "f429zi.rs"]
mod board;
#[cfg(feature = "nucleo-f767zi")]
#[path = "f767zi.rs"]
mod board;
#[cfg(feature = "nucleo-h753zi")]
#[path = "h753zi.rs"]
mod board;

#[cfg(feature = "nucleo-f429zi")]
#[path = "driver_enable_pin.rs"]
mod driver_enable;
#[cfg(not(feature = "nucleo-f429zi"))]
#[path = "driver_enable_usart.rs"]
mod driver_enable;

use embassy_executor::{SendSpawner, Spawner};
use embassy_net::Stack;
use embassy_stm32::gpio::AnyPin;
use embassy_stm32::rng::Rng;
use embassy_stm32::{Peri, uid};

pub use executor::run;
pub use leds::Leds;
pub use line::{Error as LineError, Line};
pub use lines::{BadPort, Lines};
pub use temperature::temperature;

use crate::port::embedded::{Address, Network, Place, Ports, join, limits, places};

/// What the board offers to the application.
pub struct Board {
    /// Spawns bus tasks, above everything in thread mode.
    pub buses: SendSpawner,
    /// The RS-485 lines.
    pub lines: Lines,
    /// Its LEDs.
    pub leds: Leds,
    /// The board's MAC address.
    pub mac: [u8; 6],
    stack: Stack<'static>,
}

/// What is not in the same place on every board.
struct Own {
    ld2: Peri<'static, AnyPin>,
    adc: Peri<'static, board::TemperatureAdc>,
}

impl Board {
    /// Starts clocks, network and executors. Call it once, first of all.
    #[inline(never)]
    pub fn start(spawner: Spawner) -> Self {
        log::start();
        let p = embassy_stm32::init(board::config());
        if let Some(mut core) = cortex_m::Peripherals::take() {
            board::prepare(&mut core);
        }
        let own = board::own!(p);
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
        let temperature = temperature::watch(own.adc);
        spawner.spawn(temperature.expect("the temperature is watched once"));
        can::reserve(p.PD0, p.PD1, p.PB12, p.PB6);
        Self {
            buses: executor::start(),
            lines: Lines {
                a: Some(line::a::Parts { usart: p.USART2, tx: p.PD5, rx: p.PD6, de: p.PD4 }),
                b: Some(line::b::Parts { usart: p.UART7, tx: p.PE8, rx: p.PE7, de: p.PE9 }),
            },
            leds: Leds::new(p.PB0, own.ld2, p.PB14),
            mac,
            stack: net::start(spawner, ethernet, mac, u64::from_le_bytes(seed)),
        }
    }

    /// The connection to the network.
    pub fn network(&self) -> Network {
        Network(self.stack)
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
