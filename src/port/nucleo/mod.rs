//! ST Nucleo-144 boards with Ethernet. docs/boards.md has the pins and the wiring.
//!
//! Interrupt priorities, the most urgent first: USARTs and the clock (0), CAN (1), bus tasks (6), Ethernet (8), then everything
//! else in thread mode.

mod calibration;
mod can;
mod flash;
mod leds;
mod lines;
mod mac;
#[cfg(any(feature = "nucleo-f767zi", feature = "nucleo-f429zi"))]
mod mb1137;
mod net;
mod temperature;
mod watchdog;

#[cfg(feature = "nucleo-f429zi")]
#[path = "f429zi.rs"]
mod board;
#[cfg(feature = "nucleo-f767zi")]
#[path = "f767zi.rs"]
mod board;
#[cfg(feature = "nucleo-h753zi")]
#[path = "h753zi.rs"]
mod board;

use embassy_executor::{SendSpawner, Spawner};
use embassy_stm32::gpio::{AnyPin, Input, Pull};
use embassy_stm32::peripherals::PC13;
use embassy_stm32::rng::Rng;
use embassy_stm32::{Peri, uid};

pub use can::{Can, Cans, check_can};
pub use flash::Flash;
pub use leds::Leds;
pub use lines::{BadPort, Lines, check_line};
pub use temperature::temperature;
pub use watchdog::Watchdog;

pub use super::stm32::{Line, run};
pub(super) use super::stm32::{last_words, log, logs};

use super::stm32::{executor, line, reset, start_log};
use crate::port::embedded::{Network, vital};

/// What the board offers to the application.
pub struct Board {
    /// Spawns bus tasks, above everything in thread mode.
    pub buses: SendSpawner,
    /// The RS-485 lines.
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
    /// Where the settings are kept; none where the flash is not as this image knows it.
    pub flash: Option<Flash>,
    /// The user button is held.
    pub button: bool,
    /// A random number, another at each start.
    pub seed: u64,
}

/// What must not go on when the firmware fails: there is nothing, for the drives watch over themselves.
pub(super) fn disarm() {}

/// What is not in the same place on every board.
struct Own {
    ld2: Peri<'static, AnyPin>,
    adc: Peri<'static, board::TemperatureAdc>,
    can1: Peri<'static, board::CAN1>,
    can2: Peri<'static, board::CAN2>,
}

impl Board {
    /// Starts clocks, network and executors. Call it once, first of all.
    #[inline(never)]
    pub fn start(spawner: Spawner) -> Self {
        let moving = vital::begin(Some(reset::cause()));
        start_log();
        let p = embassy_stm32::init(board::config());
        if let Some(mut core) = cortex_m::Peripherals::take() {
            board::prepare(&mut core);
        }
        let own = board::own!(p);
        let mut random = Rng::new(p.RNG, board::RandomInterrupt);
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
        let cans = Cans::new((own.can1, p.PD0, p.PD1), (own.can2, p.PB12, p.PB6));
        Self {
            buses: executor::start(),
            lines: Lines {
                a: Some(line::a::Parts { usart: p.USART2, tx: p.PD5, rx: p.PD6, de: p.PD4 }),
                b: Some(line::b::Parts { usart: p.UART7, tx: p.PE8, rx: p.PE7, de: p.PE9 }),
            },
            cans,
            leds: Leds::new(p.PB0, own.ld2, p.PB14),
            mac,
            moving,
            network: net::start(spawner, ethernet, mac, random.next_u64()),
            seed: random.next_u64(),
            flash: Flash::new(p.FLASH),
            button: is_held(p.PC13),
        }
    }
}

/// Whether the button is held, which connects its pin to 3V3 (UM2407, UM1974): for some milliseconds, lest a disturbance
/// be taken for it.
fn is_held(pin: Peri<'static, PC13>) -> bool {
    let pin = Input::new(pin, Pull::Down);
    (0..16).all(|_| {
        cortex_m::asm::delay(100_000);
        pin.is_high()
    })
}
