//! The CAN buses by the names that they have on the boards: SLCAN adapters behind UART3 and UART4.

use puente_slcan::{Config, Rate};

use super::lines::BadPort;
use super::uart::{UART3, UART4, Uart};
use crate::port::slcan::Slcan;

/// Events of a bus that nobody has read yet.
const EVENTS: usize = 32;

/// An open bus.
pub type Can = Slcan<&'static Uart, EVENTS>;

/// The buses that are not open yet.
pub struct Cans {
    one: Option<&'static Uart>,
    two: Option<&'static Uart>,
}

/// Whether a bus can have this `port` with this bit rate.
pub fn check_can(port: &str, bitrate: u32) -> Result<(), BadPort> {
    if !matches!(port, "can-1" | "can-2") {
        return Err(BadPort::Can);
    }
    Rate::of(bitrate).map(|_| ()).ok_or(BadPort::BitRate)
}

impl Cans {
    /// All buses. Call it once.
    pub(super) fn new() -> Self {
        Self { one: Some(&UART3), two: Some(&UART4) }
    }

    /// Opens `can-1` (UART3) or `can-2` (UART4), each once.
    pub fn open(&mut self, port: &str, bitrate: u32) -> Result<Can, BadPort> {
        let rate = Rate::of(bitrate).ok_or(BadPort::BitRate)?;
        let uart = match port {
            "can-1" => self.one.take(),
            "can-2" => self.two.take(),
            _ => None,
        };
        let uart = uart.ok_or(BadPort::Can)?;
        uart.start();
        Ok(Slcan::new(uart, Config { rate }))
    }
}
