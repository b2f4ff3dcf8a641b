//! The lines by the names that they have on the boards.

use core::fmt;

use puente_line::Settings;

use super::line::{Line, UART1, UART2, Uart};

/// The lines that are not open yet.
pub struct Lines {
    a: Option<&'static Uart>,
    b: Option<&'static Uart>,
}

/// A bus' `port` that this board cannot give it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadPort {
    /// There is no such line, or another bus has it.
    Line,
    /// There is no such CAN bus, or another bus has it.
    Can,
    /// No bit rate of CAN.
    BitRate,
}

impl fmt::Display for BadPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Line => "expected \"rs485-a\" or \"rs485-b\", each for one bus",
            Self::Can => "expected \"can-1\" or \"can-2\", each for one bus",
            Self::BitRate => "expected 10, 20, 50, 100, 125, 250, 500, 800 or 1000 kbit/s",
        })
    }
}

/// Whether a bus can have this `port`. The lines take any baud rate and format.
pub fn check_line(port: &str, _: Settings) -> Result<(), BadPort> {
    if matches!(port, "rs485-a" | "rs485-b") { Ok(()) } else { Err(BadPort::Line) }
}

impl Lines {
    /// All lines. Call it once.
    pub(super) fn new() -> Self {
        Self { a: Some(&UART1), b: Some(&UART2) }
    }

    /// Opens `rs485-a` (UART1) or `rs485-b` (UART2), each once.
    pub fn open(&mut self, port: &str, settings: Settings) -> Result<Line, BadPort> {
        let uart = match port {
            "rs485-a" => self.a.take(),
            "rs485-b" => self.b.take(),
            _ => None,
        };
        uart.map(|uart| Line::new(uart, settings)).ok_or(BadPort::Line)
    }
}
