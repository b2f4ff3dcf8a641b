//! The board's LEDs, of which QEMU shows none: they can be read in their register.

use super::registers::SCC;
use crate::port::{Lamps, Lights};

/// SCC: one bit a LED.
const CFG1: usize = 0x04;

/// LED 0 link, LED 1 bus, LED 2 fault.
pub struct Leds;

impl Lamps for Leds {
    fn show(&mut self, lights: Lights) {
        let bits = [lights.link, lights.bus, lights.fault].into_iter().map(u32::from);
        SCC.write(CFG1, bits.rev().fold(0, |leds, bit| leds << 1 | bit));
    }
}
