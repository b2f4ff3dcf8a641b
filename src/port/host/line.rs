//! A serial line of the host, whatever is behind it. What breaks is opened anew.

use std::cell::{Cell, RefCell};
use std::fmt;
use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::net::{TcpStream, ToSocketAddrs};
use std::rc::Rc;

use async_io::Async;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_time::{Duration, Timer, with_timeout};
use embedded_io_async::{ErrorType, Read, Write};
use puente_line::Settings;
use puente_modbus::Mode;

use super::sim::{Sim, Simulation};
use super::tty;
use crate::port::{LineReader, LineWriter, SerialLine};

const RETRY: Duration = Duration::from_secs(1);
const LATENCY: puente_line::Duration = puente_line::Duration::from_millis(10);
const CONNECT: Duration = Duration::from_secs(2);

/// Where a line is.
#[derive(Clone, Debug)]
pub enum LineSpec {
    /// In process.
    Sim(Simulation),
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
pub enum BadPort {
    /// No serial line.
    Line,
    /// No CAN port.
    Can,
    /// A CAN port that cannot do this bit rate.
    BitRate,
}

impl fmt::Display for BadPort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Line => "expected \"sim\", a serial device such as \"/dev/ttyUSB0\", or \"tcp:HOST:PORT\"",
            Self::Can => {
                "expected \"sim\", \"slcan:/dev/ttyACM0\", \"slcan:tcp:HOST:PORT\" or \"socketcan:can0\""
            }
            Self::BitRate => "an SLCAN adapter has 10, 20, 50, 100, 125, 250, 500, 750, 800 and 1000 kbit/s",
        })
    }
}

impl LineSpec {
    /// Reads the `port` of a bus; `sim` tells what the simulated cell is made of, where there is one for this bus.
    pub fn parse(
        port: &str,
        settings: Settings,
        sim: impl FnOnce() -> Option<Simulation>,
    ) -> Result<Self, BadPort> {
        if port == "sim" {
            return sim().map(Self::Sim).ok_or(BadPort::Line);
        }
        if let Some(address) = port.strip_prefix("tcp:") {
            return if is_address(address) { Ok(Self::Tcp(address.to_owned())) } else { Err(BadPort::Line) };
        }
        if port.starts_with('/') {
            Ok(Self::Tty { path: port.to_owned(), settings })
        } else {
            Err(BadPort::Line)
        }
    }

    fn name(&self) -> &str {
        match self {
            LineSpec::Sim(_) => "sim",
            LineSpec::Tty { path, .. } => path,
            LineSpec::Tcp(address) => address,
        }
    }
}

/// Whether this is `HOST:PORT`.
pub(super) fn is_address(address: &str) -> bool {
    address
        .rsplit_once(':')
        .is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port != 0))
}

/// Whether a bus can have this `port`. Whether there is such a device tells only its use.
pub fn check_line(port: &str, settings: Settings) -> Result<(), BadPort> {
    let nothing = || Some(Simulation::Modbus(puente_cell::Config::new(Mode::Ascii, settings, &[])));
    LineSpec::parse(port, settings, nothing).map(|_| ())
}

/// What a line is connected with at present.
#[derive(Clone)]
enum Wire {
    Sim(Rc<Sim>),
    Tty(Rc<Async<File>>),
    Tcp(Rc<Async<TcpStream>>),
}

impl Wire {
    async fn read(&self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Sim(sim) => return Ok(sim.read(buffer).await),
            Self::Tty(file) => file.read_with(|mut file| file.read(buffer)).await,
            Self::Tcp(stream) => stream.read_with(|mut stream| stream.read(buffer)).await,
        }
        .and_then(|count| some(count, io::ErrorKind::UnexpectedEof))
    }

    async fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Sim(sim) => Ok(sim.write(bytes)),
            Self::Tty(file) => file.write_with(|mut file| file.write(bytes)).await,
            Self::Tcp(stream) => stream.write_with(|mut stream| stream.write(bytes)).await,
        }
        .and_then(|count| some(count, io::ErrorKind::WriteZero))
    }

    /// Whether both are the same connection.
    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Sim(a), Self::Sim(b)) => Rc::ptr_eq(a, b),
            (Self::Tty(a), Self::Tty(b)) => Rc::ptr_eq(a, b),
            (Self::Tcp(a), Self::Tcp(b)) => Rc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// Nothing where there should be something is an error.
fn some(count: usize, otherwise: io::ErrorKind) -> io::Result<usize> {
    if count > 0 { Ok(count) } else { Err(otherwise.into()) }
}

/// A serial line.
pub struct Line {
    spec: LineSpec,
    wire: RefCell<Option<Wire>>,
    /// Held while it is opened, so that the halves do not both do it.
    opening: Mutex<NoopRawMutex, ()>,
    /// The last failure has been told.
    told: Cell<bool>,
}

impl Line {
    /// A line; it is opened with its first use.
    pub fn new(spec: LineSpec) -> Self {
        Self { spec, wire: RefCell::new(None), opening: Mutex::new(()), told: Cell::new(false) }
    }

    fn wire(&self) -> Option<Wire> {
        self.wire.borrow().clone()
    }

    /// Reads what is there, once it is open.
    pub(super) async fn read_open(&self, buffer: &mut [u8]) -> io::Result<usize> {
        let wire = self.wire().ok_or(io::ErrorKind::NotConnected)?;
        wire.read(buffer).await.inspect_err(|error| self.lost(&wire, error))
    }

    /// Opens it where it is not, and writes.
    pub(super) async fn write(&self, bytes: &[u8]) -> io::Result<usize> {
        let wire = self.open().await.map_err(|error| io::Error::new(io::ErrorKind::NotConnected, error))?;
        wire.write(bytes).await.inspect_err(|error| self.lost(&wire, error))
    }

    /// Opens it where it is not; false where that fails.
    pub(super) async fn ready(&self) -> bool {
        self.open().await.is_ok()
    }

    async fn open(&self) -> io::Result<Wire> {
        if let Some(wire) = self.wire() {
            return Ok(wire);
        }
        let _opening = self.opening.lock().await;
        // The other half may have done it meanwhile.
        if let Some(wire) = self.wire() {
            return Ok(wire);
        }
        let opened = match &self.spec {
            LineSpec::Sim(simulation) => Sim::new(simulation).map(|sim| Wire::Sim(Rc::new(sim))),
            LineSpec::Tty { path, settings } => {
                tty::open(path, *settings).and_then(Async::new).map(|file| Wire::Tty(Rc::new(file)))
            }
            LineSpec::Tcp(address) => connect(address).await.map(|stream| Wire::Tcp(Rc::new(stream))),
        };
        match opened {
            Ok(wire) => {
                log::info!("line {} is open", self.spec.name());
                self.wire.replace(Some(wire.clone()));
                self.told.set(false);
                Ok(wire)
            }
            Err(error) => {
                self.tell(&error);
                Err(error)
            }
        }
    }

    /// This connection is of no use any more. There may be a new one already.
    fn lost(&self, wire: &Wire, error: &io::Error) {
        let mut current = self.wire.borrow_mut();
        if current.as_ref().is_some_and(|current| current.is(wire)) {
            self.tell(error);
            *current = None;
        }
    }

    fn tell(&self, error: &io::Error) {
        if !self.told.replace(true) {
            log::error!("line {}: {error}; trying again", self.spec.name());
        }
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

impl SerialLine for Line {
    type Error = io::Error;
    type Reader<'a> = Reader<'a>;
    type Writer<'a> = Writer<'a>;

    fn split(&mut self) -> (Reader<'_>, Writer<'_>) {
        (Reader(self), Writer(self))
    }
}

/// The receiving half.
pub struct Reader<'a>(&'a Line);

impl ErrorType for Reader<'_> {
    type Error = io::Error;
}

impl Read for Reader<'_> {
    async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let wire = loop {
            match self.0.open().await {
                Ok(wire) => break wire,
                Err(_) => Timer::after(RETRY).await,
            }
        };
        wire.read(buffer).await.inspect_err(|error| self.0.lost(&wire, error))
    }
}

impl LineReader for Reader<'_> {
    /// What a system may take that has other things to do, or an adapter that collects characters.
    fn latency(&self) -> puente_line::Duration {
        LATENCY
    }

    fn carrier(&self) -> bool {
        match self.0.wire() {
            Some(Wire::Sim(sim)) => sim.carrier(),
            // The system does not tell.
            _ => false,
        }
    }
}

/// The sending half.
pub struct Writer<'a>(&'a Line);

impl ErrorType for Writer<'_> {
    type Error = io::Error;
}

impl Write for Writer<'_> {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes).await
    }

    /// The system does not tell what is on the line; that the line is open is what can be said.
    async fn flush(&mut self) -> io::Result<()> {
        self.0.open().await.map(|_| ())
    }
}

impl LineWriter for Writer<'_> {
    /// Of a serial device, what the system has of it. What is given to TCP is sent.
    fn discard(&mut self) {
        match self.0.wire() {
            Some(Wire::Tty(file)) => tty::discard(&file),
            Some(Wire::Sim(sim)) => sim.discard(),
            Some(Wire::Tcp(_)) | None => {}
        }
    }
}

#[cfg(test)]
mod tests;
