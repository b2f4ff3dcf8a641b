//! The RS-485 lines by their names.

use core::fmt;

use puente_line::{Parity, Settings};

use super::board;
use crate::port::stm32::line::{Line, a, b, config};

/// The lines that are not open yet.
pub struct Lines {
    pub(super) a: Option<a::Parts>,
    pub(super) b: Option<b::Parts>,
}

/// A bus' `port` that this board cannot give it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BadPort {
    /// There is no such line, or another bus has it.
    Unknown,
    /// The line cannot do this baud rate or format.
    Settings,
    /// There is no such CAN bus, or another bus has it.
    Can,
    /// The CAN controller cannot do this bit rate exactly.
    BitRate,
}

impl fmt::Display for BadPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            BadPort::Unknown => "expected \"rs485-a\" or \"rs485-b\", each for one bus",
            BadPort::Settings => "the USART cannot do this baud rate or format",
            BadPort::Can => "expected \"can-1\" or \"can-2\", each for one bus",
            BadPort::BitRate => "the CAN controller cannot do this bit rate exactly",
        })
    }
}

/// Whether a bus can have this `port`, with this baud rate and format.
pub fn check_line(port: &str, settings: Settings) -> Result<(), BadPort> {
    if !matches!(port, "rs485-a" | "rs485-b") {
        return Err(BadPort::Unknown);
    }
    let format = settings.format;
    let seven = format.data_bits == 7 && format.parity == Parity::None;
    let can =
        config(settings).is_ok() && (board::SEVEN_BITS || !seven) && board::BAUD.contains(&settings.baud);
    if can { Ok(()) } else { Err(BadPort::Settings) }
}

impl Lines {
    /// Opens `rs485-a` (USART2) or `rs485-b` (UART7), each once.
    pub fn open(&mut self, port: &str, settings: Settings) -> Result<Line, BadPort> {
        let opened = match port {
            "rs485-a" => self.a.take().ok_or(BadPort::Unknown)?.open(settings),
            "rs485-b" => self.b.take().ok_or(BadPort::Unknown)?.open(settings),
            _ => return Err(BadPort::Unknown),
        };
        opened.map_err(|_| BadPort::Settings)
    }
}
