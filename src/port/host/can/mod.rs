//! The CAN ports of the host.

mod sim;
#[cfg(target_os = "linux")]
mod socketcan;
#[cfg(test)]
mod tests;

use puente_canopen::Frame;
use puente_cell::can::Config;
use puente_line::{Format, Parity, Settings};
use puente_slcan::Rate;

use self::sim::Sim;
#[cfg(target_os = "linux")]
use self::socketcan::Socketcan;
use super::line::{BadPort, Line, LineSpec, is_address};
use crate::port::slcan::{self, Slcan, Wire};
use crate::port::{CanCounters, CanEvent, CanPort, CanReader, CanWriter, NotTaken};

/// Events of a bus that nobody has read yet.
const EVENTS: usize = 256;
/// Longest name of a network interface (IFNAMSIZ without its last zero).
const INTERFACE: usize = 15;
/// Baud rate of an adapter's serial device. Most are USB devices that have none; the others must be set to it.
const BAUD: u32 = 115_200;

/// Where a CAN bus is.
#[derive(Clone, Debug)]
pub enum CanSpec {
    /// In process, at the cell's port 0.
    Sim(Config),
    /// An SLCAN adapter behind a serial device or a TCP connection.
    Slcan {
        /// Where it is.
        line: LineSpec,
        /// Of the bus.
        rate: Rate,
    },
    /// A network interface of Linux, by its name. The system has set its bit rate.
    Socketcan(String),
}

impl CanSpec {
    /// Reads the `port` of a bus with a bit rate in bit/s; `sim` tells what the simulated cell is made of.
    pub fn parse(port: &str, bitrate: u32, sim: impl FnOnce() -> Config) -> Result<Self, BadPort> {
        if port == "sim" {
            return Ok(Self::Sim(sim()));
        }
        if let Some(interface) = port.strip_prefix("socketcan:") {
            let valid = (1..=INTERFACE).contains(&interface.len()) && !interface.contains(['/', ' ']);
            let here = cfg!(target_os = "linux");
            return if valid && here { Ok(Self::Socketcan(interface.to_owned())) } else { Err(BadPort::Can) };
        }
        let port = port.strip_prefix("slcan:").ok_or(BadPort::Can)?;
        let line = match port.strip_prefix("tcp:") {
            Some(address) if is_address(address) => LineSpec::Tcp(address.to_owned()),
            None if port.starts_with('/') => LineSpec::Tty { path: port.to_owned(), settings: settings() },
            _ => return Err(BadPort::Can),
        };
        let rate = Rate::of(bitrate).ok_or(BadPort::BitRate)?;
        Ok(Self::Slcan { line, rate })
    }
}

fn settings() -> Settings {
    Settings { baud: BAUD, format: Format { data_bits: 8, parity: Parity::None, stop_bits: 1 } }
}

/// Whether a bus can have this `port` with this bit rate. Whether there is such a device tells only its use.
pub fn check_can(port: &str, bitrate: u32) -> Result<(), BadPort> {
    CanSpec::parse(port, bitrate, || Config::new(bitrate)).map(|_| ())
}

/// A CAN port.
pub struct Can(Kind);

enum Kind {
    Sim(Box<Sim>),
    Slcan(Box<Slcan<Line, EVENTS>>),
    #[cfg(target_os = "linux")]
    Socketcan(Socketcan),
}

impl Can {
    /// A port; it is opened with its first use.
    pub fn new(spec: CanSpec) -> Self {
        Self(match spec {
            CanSpec::Sim(config) => Kind::Sim(Box::new(Sim::new(config))),
            CanSpec::Slcan { line, rate } => {
                Kind::Slcan(Box::new(Slcan::new(Line::new(line), puente_slcan::Config { rate })))
            }
            #[cfg(target_os = "linux")]
            CanSpec::Socketcan(interface) => Kind::Socketcan(Socketcan::new(interface)),
            #[cfg(not(target_os = "linux"))]
            CanSpec::Socketcan(_) => unreachable!("no text is parsed to this"),
        })
    }
}

impl Wire for Line {
    async fn open(&self) -> bool {
        self.ready().await
    }

    async fn read(&self, buffer: &mut [u8]) -> Option<usize> {
        self.read_open(buffer).await.ok()
    }

    async fn write(&self, bytes: &[u8]) -> Option<usize> {
        Line::write(self, bytes).await.ok()
    }
}

impl CanPort for Can {
    type Reader<'a> = Reader<'a>;
    type Writer<'a> = Writer<'a>;

    fn split(&mut self) -> (Reader<'_>, Writer<'_>) {
        match &mut self.0 {
            Kind::Sim(sim) => (Reader(Reads::Sim(sim)), Writer(Writes::Sim(sim))),
            Kind::Slcan(slcan) => {
                let (reader, writer) = slcan.split();
                (Reader(Reads::Slcan(reader)), Writer(Writes::Slcan(writer)))
            }
            #[cfg(target_os = "linux")]
            Kind::Socketcan(socket) => (Reader(Reads::Socketcan(socket)), Writer(Writes::Socketcan(socket))),
        }
    }
}

/// The receiving half.
pub struct Reader<'a>(Reads<'a>);

enum Reads<'a> {
    Sim(&'a Sim),
    Slcan(slcan::Reader<'a, Line, EVENTS>),
    #[cfg(target_os = "linux")]
    Socketcan(&'a Socketcan),
}

impl CanReader for Reader<'_> {
    async fn read(&mut self) -> CanEvent {
        match &mut self.0 {
            Reads::Sim(sim) => sim.read().await,
            Reads::Slcan(reader) => reader.read().await,
            #[cfg(target_os = "linux")]
            Reads::Socketcan(socket) => socket.read().await,
        }
    }

    fn counters(&self) -> CanCounters {
        match &self.0 {
            Reads::Sim(sim) => sim.counters(),
            Reads::Slcan(reader) => reader.counters(),
            #[cfg(target_os = "linux")]
            Reads::Socketcan(socket) => socket.counters(),
        }
    }
}

/// The sending half.
pub struct Writer<'a>(Writes<'a>);

enum Writes<'a> {
    Sim(&'a Sim),
    Slcan(slcan::Writer<'a, Line, EVENTS>),
    #[cfg(target_os = "linux")]
    Socketcan(&'a Socketcan),
}

impl CanWriter for Writer<'_> {
    async fn write(&mut self, frame: &Frame) -> Result<(), NotTaken> {
        match &mut self.0 {
            Writes::Sim(sim) => sim.write(frame).await,
            Writes::Slcan(writer) => writer.write(frame).await,
            #[cfg(target_os = "linux")]
            Writes::Socketcan(socket) => socket.write(frame).await,
        }
    }

    fn discard(&mut self) {
        match &mut self.0 {
            Writes::Sim(sim) => sim.discard(),
            Writes::Slcan(writer) => writer.discard(),
            // The system has them.
            #[cfg(target_os = "linux")]
            Writes::Socketcan(_) => {}
        }
    }
}
