//! The LEDs of the board.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Level, Output, Pin, Speed};

use crate::port::{Lamps, Lights};

/// LD1 link, LD2 bus, LD3 fault.
pub struct Leds([Output<'static>; 3]);

impl Leds {
    /// All dark.
    pub(super) fn new(
        ld1: Peri<'static, impl Pin>,
        ld2: Peri<'static, AnyPin>,
        ld3: Peri<'static, impl Pin>,
    ) -> Self {
        let dark = |pin| Output::new(pin, Level::Low, Speed::Low);
        Self([ld1.into(), ld2, ld3.into()].map(dark))
    }
}

impl Lamps for Leds {
    fn show(&mut self, lights: Lights) {
        for (led, on) in self.0.iter_mut().zip([lights.link, lights.bus, lights.fault]) {
            led.set_level(Level::from(on));
        }
    }
}
