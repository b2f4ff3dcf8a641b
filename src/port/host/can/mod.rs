//! The CAN ports of the host.

use core::future::pending;

use puente_canopen::Frame;

use super::line::{BadPort, is_address};
use crate::port::{BIT_RATES, CanCounters, CanEvent, CanPort, CanReader, CanState, CanWriter, NotTaken};

/// Where a CAN bus is.
#[derive(Clone, Debug)]
pub enum CanSpec {
    /// In process.
    Sim,
    /// An SLCAN adapter behind a serial device or a TCP connection.
    Slcan {
        /// Path of the device, or `tcp:HOST:PORT`.
        line: String,
        /// In bit/s.
        bitrate: u32,
    },
    /// A network interface of Linux, by its name.
    Socketcan(String),
}

/// Longest name of a network interface (IFNAMSIZ without its last zero).
const INTERFACE: usize = 15;

impl CanSpec {
    /// Reads the `port` of a bus.
    pub fn parse(port: &str, bitrate: u32) -> Result<Self, BadPort> {
        if port == "sim" {
            return Ok(Self::Sim);
        }
        if let Some(interface) = port.strip_prefix("socketcan:") {
            let valid = (1..=INTERFACE).contains(&interface.len()) && !interface.contains(['/', ' ']);
            return if valid { Ok(Self::Socketcan(interface.to_owned())) } else { Err(BadPort::Can) };
        }
        let line = port.strip_prefix("slcan:").ok_or(BadPort::Can)?;
        let is_line = line.strip_prefix("tcp:").map_or(line.starts_with('/'), is_address);
        if !is_line {
            return Err(BadPort::Can);
        }
        if !BIT_RATES.contains(&bitrate) && bitrate != 750_000 {
            return Err(BadPort::BitRate);
        }
        Ok(Self::Slcan { line: line.to_owned(), bitrate })
    }
}

/// Whether a bus can have this `port` with this bit rate. Whether there is such a device tells only its use.
pub fn check_can(port: &str, bitrate: u32) -> Result<(), BadPort> {
    CanSpec::parse(port, bitrate).map(|_| ())
}

/// A CAN port.
pub struct Can(#[expect(dead_code)] CanSpec);

impl Can {
    /// A port; it is opened with its first use.
    pub fn new(spec: CanSpec) -> Self {
        Self(spec)
    }
}

impl CanPort for Can {
    type Reader<'a> = Reader<'a>;
    type Writer<'a> = Writer<'a>;

    fn split(&mut self) -> (Reader<'_>, Writer<'_>) {
        (Reader(self), Writer(self))
    }
}

/// The receiving half.
pub struct Reader<'a>(#[expect(dead_code)] &'a Can);

impl CanReader for Reader<'_> {
    async fn read(&mut self) -> CanEvent {
        pending().await
    }

    fn counters(&self) -> CanCounters {
        CanCounters::default()
    }
}

/// The sending half.
pub struct Writer<'a>(#[expect(dead_code)] &'a Can);

impl CanWriter for Writer<'_> {
    async fn write(&mut self, _: &Frame) -> Result<(), NotTaken> {
        Err(NotTaken(CanState::Down))
    }

    fn discard(&mut self) {}
}
