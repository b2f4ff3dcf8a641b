//! A serial line of the host, whatever is behind it. What breaks is opened anew.

use std::fmt;
use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs};

use async_io::Async;
use embassy_time::{Duration, Timer, with_timeout};
use embedded_io_async::{ErrorType, Read, Write};
use puente_line::Settings;
use puente_modbus::Mode;

use super::sim::Sim;
use super::tty;
use crate::port::SerialLine;

const RETRY: Duration = Duration::from_secs(1);
const CONNECT: Duration = Duration::from_secs(2);

/// Where a line is.
#[derive(Clone, Debug)]
pub enum LineSpec {
    /// In process.
    Sim(puente_cell::Config),
    /// A serial device.
    Tty {
        /// Its path.
        path: String,
        /// Baud rate and format.
        settings: Settings,
    },
    /// Raw bytes over TCP, as `HOST:PORT`.
    Tcp(String),
}

/// A port's name that cannot be one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadPort;

impl fmt::Display for BadPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected \"sim\", a serial device such as \"/dev/ttyUSB0\", or \"tcp:HOST:PORT\"")
    }
}

impl LineSpec {
    /// Reads the `port` of a bus; `sim` tells what the simulated cell is made of.
    pub fn parse(
        port: &str,
        settings: Settings,
        sim: impl FnOnce() -> puente_cell::Config,
    ) -> Result<Self, BadPort> {
        if port == "sim" {
            return Ok(Self::Sim(sim()));
        }
        if let Some(address) = port.strip_prefix("tcp:") {
            let valid = address.rsplit_once(':').is_some_and(|(host, port)| {
                !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port != 0)
            });
            return if valid { Ok(Self::Tcp(address.to_owned())) } else { Err(BadPort) };
        }
        if port.starts_with('/') { Ok(Self::Tty { path: port.to_owned(), settings }) } else { Err(BadPort) }
    }

    fn name(&self) -> &str {
        match self {
            LineSpec::Sim(_) => "sim",
            LineSpec::Tty { path, .. } => path,
            LineSpec::Tcp(address) => address,
        }
    }
}

/// Whether a bus can have this `port`. Whether there is such a device tells only its use.
pub fn check_line(port: &str, settings: Settings) -> Result<(), BadPort> {
    LineSpec::parse(port, settings, || puente_cell::Config::new(Mode::Ascii, settings, &[])).map(|_| ())
}

enum Wire {
    Closed,
    Sim(Box<Sim>),
    Tty(Async<File>),
    Tcp(Async<TcpStream>),
}

/// A serial line.
pub struct Line {
    spec: LineSpec,
    wire: Wire,
    /// The last failure has been told.
    told: bool,
}

impl Line {
    /// A line; it is opened with its first use.
    pub fn new(spec: LineSpec) -> Self {
        Self { spec, wire: Wire::Closed, told: false }
    }

    async fn open(&mut self) -> io::Result<()> {
        if !matches!(self.wire, Wire::Closed) {
            return Ok(());
        }
        let opened = match &self.spec {
            LineSpec::Sim(config) => Ok(Wire::Sim(Box::new(Sim::new(config.clone())))),
            LineSpec::Tty { path, settings } => {
                tty::open(path, *settings).and_then(Async::new).map(Wire::Tty)
            }
            LineSpec::Tcp(address) => connect(address).await.map(Wire::Tcp),
        };
        match opened {
            Ok(wire) => {
                log::info!("line {} is open", self.spec.name());
                self.wire = wire;
                self.told = false;
                Ok(())
            }
            Err(error) => Err(self.lost(error)),
        }
    }

    fn lost(&mut self, error: io::Error) -> io::Error {
        if !self.told {
            log::error!("line {}: {error}; trying again", self.spec.name());
            self.told = true;
        }
        self.wire = Wire::Closed;
        error
    }
}

async fn connect(address: &str) -> io::Result<Async<TcpStream>> {
    let resolved = address.to_socket_addrs()?.next().ok_or(io::ErrorKind::NotFound)?;
    match with_timeout(CONNECT, Async::<TcpStream>::connect(resolved)).await {
        Ok(stream) => {
            let stream = stream?;
            stream.get_ref().set_nodelay(true)?;
            Ok(stream)
        }
        Err(_) => Err(io::ErrorKind::TimedOut.into()),
    }
}

impl SerialLine for Line {}

impl ErrorType for Line {
    type Error = io::Error;
}

impl Read for Line {
    async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.open().await.is_err() {
            Timer::after(RETRY).await;
        }
        let read = match &mut self.wire {
            Wire::Closed => Ok(0),
            Wire::Sim(sim) => return Ok(sim.read(buffer).await),
            Wire::Tty(file) => file.read_with(|mut file| file.read(buffer)).await,
            Wire::Tcp(stream) => stream.read_with(|mut stream| stream.read(buffer)).await,
        };
        match read {
            Ok(0) => Err(self.lost(io::ErrorKind::UnexpectedEof.into())),
            Err(error) => Err(self.lost(error)),
            Ok(count) => Ok(count),
        }
    }
}

impl Write for Line {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.open().await.map_err(|error| io::Error::new(io::ErrorKind::NotConnected, error))?;
        let written = match &mut self.wire {
            Wire::Closed => Ok(0),
            Wire::Sim(sim) => {
                sim.write(bytes);
                return Ok(bytes.len());
            }
            Wire::Tty(file) => file.write_with(|mut file| file.write(bytes)).await,
            Wire::Tcp(stream) => stream.write_with(|mut stream| stream.write(bytes)).await,
        };
        match written {
            Ok(0) => Err(self.lost(io::ErrorKind::WriteZero.into())),
            Err(error) => Err(self.lost(error)),
            Ok(count) => Ok(count),
        }
    }

    async fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
