//! NUCLEO-G474RE (MB1367) as a PID interface module. docs/module.md has the pins and the wiring.
//!
//! Interrupt priorities, the most urgent first: the loop (0), the USART and the clock (1), bus tasks (6), then everything
//! else in thread mode.

mod axis;
mod clocks;
mod command;
mod encoder;
mod lamp;
mod tick;
mod watchdog;

use embassy_executor::{SendSpawner, Spawner};
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, Pull, Speed};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::rng::{self, Rng};
use embassy_stm32::{Peri, bind_interrupts, interrupt, pac, peripherals};

pub use super::stm32::{Line, run};
pub(super) use super::stm32::{last_words, log, logs};

use super::stm32::line::c;
use super::stm32::{executor, reset, start_log};
use crate::port::embedded::vital;
use crate::port::{Bus, CommandForm, Feedback};
pub use axis::Axis;
use command::Command;
use encoder::Encoder;
pub use lamp::Lamp;
pub use tick::Tick;
use watchdog::Watchdog;

bind_interrupts!(struct Interrupts {
    RNG => rng::InterruptHandler<peripherals::RNG>;
});

/// What the board offers to the application.
pub struct AxisBoard {
    /// Spawns bus tasks, above everything in thread mode.
    pub buses: SendSpawner,
    /// The bus,
    pub bus: Bus,
    /// and its line.
    pub line: Line,
    /// Encoder and amplifier.
    pub axis: Axis,
    /// The user LED.
    pub lamp: Lamp,
    /// What the switch for the address says: 0 to 15.
    pub switch: u8,
    /// A random number, another at each start.
    pub seed: u64,
    /// What steps the loop.
    pub tick: Tick,
}

impl AxisBoard {
    /// Starts clocks and executors, with the amplifier off. Call it once, first of all.
    #[inline(never)]
    pub fn start(_: Spawner, bus: Bus, feedback: Feedback, form: CommandForm) -> Self {
        vital::begin(Some(reset::cause()));
        start_log();
        let p = embassy_stm32::init(clocks::config());
        clocks::prepare();
        interrupt::TIM5.set_priority(Priority::P1);
        let low = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
        // First of all: until now a resistor holds it low.
        let enable = low(p.PB5.into());
        let command = match form {
            CommandForm::Voltage => Command::voltage(p.DAC1, p.PA4),
            CommandForm::Pwm => Command::pwm(p.TIM3, p.PA6, low(p.PA7.into())),
        };
        let encoder = match feedback {
            Feedback::Quadrature => Encoder::quadrature(p.TIM2, p.PA0, p.PA1),
            Feedback::Ssi { format, .. } => Encoder::ssi(format, p.SPI3, p.PC10, p.PC11),
            Feedback::Parallel(width) => Encoder::parallel(
                width,
                [
                    p.PC0.into(),
                    p.PC1.into(),
                    p.PC2.into(),
                    p.PC3.into(),
                    p.PC6.into(),
                    p.PC7.into(),
                    p.PC8.into(),
                    p.PC9.into(),
                    p.PC10.into(),
                    p.PC11.into(),
                    p.PC12.into(),
                    p.PB11.into(),
                    p.PB12.into(),
                    p.PB13.into(),
                    p.PB14.into(),
                    p.PB15.into(),
                ],
            ),
        };
        let ready = Input::new(p.PB10, Pull::Up);
        let mut seed = [0; 8];
        Rng::new(p.RNG, Interrupts).fill_bytes(&mut seed);
        Self {
            buses: executor::start(),
            bus,
            line: c::Parts { usart: p.USART1, tx: p.PC4, rx: p.PC5, de: p.PA12 }
                .open(bus.line)
                .expect("a line that the USART can do"),
            axis: Axis { encoder, command, enable, ready, watchdog: Watchdog::new() },
            lamp: Lamp(low(p.PA5.into())),
            switch: switch([p.PA9.into(), p.PB2.into(), p.PA8.into(), p.PB1.into()]),
            seed: u64::from_le_bytes(seed),
            tick: Tick::new(p.TIM7),
        }
    }
}

/// What the switch says, the first pin as its lowest bit: each contact that is on connects its pin to GND.
fn switch(pins: [Peri<'static, AnyPin>; 4]) -> u8 {
    let pins = pins.map(|pin| Input::new(pin, Pull::Up));
    // The pull-ups have the lines of the switch to charge.
    cortex_m::asm::delay(100_000);
    pins.iter().rev().fold(0, |number, pin| number << 1 | u8::from(pin.is_low()))
}

/// Takes the amplifier's enable line away, when the firmware fails.
pub(super) fn disarm() {
    pac::GPIOB.bsrr().write(|pins| pins.set_br(5, true));
}
