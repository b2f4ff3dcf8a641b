//! What a port supplies: sockets, serial lines, flash for the settings, and the sizes that its memory allows. Nothing above this folder names
//! a chip, an operating system or a cargo feature.

#[cfg(network)]
mod nor;

use core::fmt;

use embedded_io_async::{Error, Read, Write};
use embedded_storage_async::nor_flash::NorFlash;
use puente_drives::pid::{Encoder, EncoderFault, Width, ssi};
use puente_line::Settings;

mod can;
pub mod journal;
pub mod record;
#[cfg(any(not(target_os = "none"), feature = "mps2-an500"))]
mod slcan;

#[cfg(not(target_os = "none"))]
pub mod host;
#[cfg(not(target_os = "none"))]
use host as platform;
#[cfg(not(target_os = "none"))]
pub use host::{Place, defaults, history, limits, may_move, restart, stack};

#[cfg(target_os = "none")]
pub mod embedded;
#[cfg(all(target_os = "none", network))]
pub use embedded::{Network, Place};
#[cfg(target_os = "none")]
pub use embedded::{alive, defaults, history, hung, limits, may_move, restart, stack};

#[cfg(all(target_os = "none", feature = "mps2-an500"))]
pub mod mps2;
#[cfg(all(target_os = "none", feature = "mps2-an500"))]
use mps2 as platform;

#[cfg(all(target_os = "none", feature = "nucleo", network))]
pub mod nucleo;
#[cfg(all(target_os = "none", feature = "nucleo", network))]
use nucleo as platform;

#[cfg(all(target_os = "none", feature = "nucleo-g474re"))]
pub mod g474re;
#[cfg(all(target_os = "none", feature = "nucleo-g474re"))]
use g474re as platform;

#[cfg(all(target_os = "none", feature = "nucleo"))]
mod stm32;

pub use can::{BIT_RATES, CanCounters, CanEvent, CanPort, CanReader, CanState, CanWriter, NotTaken};
pub use platform::Line;
#[cfg(target_os = "none")]
pub use platform::run;
#[cfg(all(target_os = "none", feature = "axis-module"))]
pub use platform::{Axis, AxisBoard, Lamp, Tick};
#[cfg(network)]
pub use platform::{BadPort, Can, Flash, check_can, check_line, temperature};
#[cfg(all(target_os = "none", network))]
pub use platform::{Board, Leds, Watchdog};

#[cfg(all(target_os = "none", feature = "test-hooks"))]
pub use embedded::hooks::obey;

/// Does what a console line of a test asks for; false where it is something else, as it always is but in images for
/// tests.
#[cfg(not(all(target_os = "none", feature = "test-hooks")))]
pub fn obey(_line: &[u8]) -> bool {
    false
}

/// Name of the board, as in `cargo xtask firmware --board`; `host` on a host.
pub const NAME: &str = env!("PUENTE_BOARD");

/// How much of the stack is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stack {
    /// All of it, in bytes.
    pub size: usize,
    /// The most of it that was used at once, in bytes.
    pub used: usize,
}

/// Which of the TCP ports a client came through. A board has the first two.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Door {
    /// Port 80 (8080 on the host): the first bytes decide the dialect.
    Main,
    /// Port 502 (8502 on the host): Modbus/TCP only.
    Modbus,
    /// SLCAN only.
    Slcan,
    /// socketcand only.
    Socketcand,
}

/// A client's address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Peer {
    /// IPv4 address.
    pub ip: [u8; 4],
    /// TCP port.
    pub port: u16,
}

impl fmt::Display for Peer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d] = self.ip;
        write!(f, "{a}.{b}.{c}.{d}:{}", self.port)
    }
}

/// One accepted TCP connection.
pub trait Socket {
    /// What can go wrong; any error ends the connection.
    type Error: Error + 'static;
    /// The receiving half; `read` answers 0 once the client has closed its side.
    type Reader<'a>: Read<Error = Self::Error>
    where
        Self: 'a;
    /// The sending half.
    type Writer<'a>: Write<Error = Self::Error>
    where
        Self: 'a;

    /// Who is at the other end.
    fn peer(&self) -> Peer;
    /// Through which port the client came.
    fn door(&self) -> Door;
    /// Both halves, usable at once.
    fn split(&mut self) -> (Self::Reader<'_>, Self::Writer<'_>);
    /// Sends what is left, then FIN. Bounded in time.
    async fn close(&mut self);
    /// Ends the connection at once with RST.
    fn abort(&mut self);
}

/// One place for a client. A port opens [`limits::SLOTS`] of them.
pub trait Listener {
    /// The connection that `accept` makes.
    type Socket<'a>: Socket
    where
        Self: 'a;

    /// Waits for the next client of this place.
    async fn accept(&mut self) -> Self::Socket<'_>;
}

/// One serial line.
///
/// After an error both halves may be used again: the port reopens the line, the reader waiting where it must. A write
/// that fails with `NotConnected` has sent nothing; an error of a spoilt character is `InvalidData`.
pub trait SerialLine {
    /// What can go wrong.
    type Error: Error + 'static;
    /// The receiving half.
    type Reader<'a>: LineReader<Error = Self::Error>
    where
        Self: 'a;
    /// The sending half.
    type Writer<'a>: LineWriter<Error = Self::Error>
    where
        Self: 'a;

    /// Both halves, usable at once: the receiver is on while the line is sent to. What it hears then is for the
    /// transceiver to say.
    fn split(&mut self) -> (Self::Reader<'_>, Self::Writer<'_>);
}

/// The receiving half of a line. `read` answers with what is there, and must lose nothing when it is dropped.
pub trait LineReader: Read {
    /// The next `count` characters decide nothing before the last of them is there: `read` may wait for it, as long as
    /// they come without a pause.
    fn expect(&mut self, _count: usize) {}

    /// What is heard may come later than it was on the line by so much: what the port collects, or what is between it and
    /// the line, on the way out and back together.
    fn latency(&self) -> puente_line::Duration {
        puente_line::Duration::ZERO
    }

    /// Whether a character is arriving that has not been received yet; false where the port cannot tell.
    fn carrier(&self) -> bool {
        false
    }
}

/// The sending half of a line. `write` takes characters as soon as there is room, and waits where there is none; those
/// of one call and of the next go out without a pause. `flush` waits until the line is open, and until the last of them is
/// on it, where the port can tell. Either may be dropped; what has been taken goes out all the same.
pub trait LineWriter: Write {
    /// Drops what has been taken and not been sent: where the port can, sending ends with the character that is under
    /// way.
    fn discard(&mut self);
}

/// The bus of a PID interface module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bus {
    /// Baud rate and format.
    pub line: Settings,
    /// Silence before a frame, in characters.
    pub gap: usize,
    /// Unit of the back-off, in characters.
    pub slot: usize,
}

/// How the encoder of a PID interface module tells where the axis is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feedback {
    /// Incremental: two lines with edges, which are counted.
    Quadrature,
    /// Absolute: Gray code of up to 16 bits, a wire a bit.
    Parallel(Width),
    /// Absolute: clocked out bit by bit. The code is Gray, or binary.
    Ssi {
        /// How an answer is made up; at most 32 samples.
        format: ssi::Format,
        /// Whether the code is Gray.
        gray: bool,
    },
}

impl Feedback {
    /// What its samples are.
    pub const fn encoder(self) -> Encoder {
        match self {
            Self::Quadrature => Encoder::Binary(Width::W32),
            Self::Parallel(width) => Encoder::Gray(width),
            Self::Ssi { format, gray: true } => Encoder::Gray(format.width),
            Self::Ssi { format, gray: false } => Encoder::Binary(format.width),
        }
    }
}

/// How the amplifier of a PID interface module is told its command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandForm {
    /// As a voltage.
    Voltage,
    /// As a duty cycle with a line for the direction.
    Pwm,
}

/// Encoder and amplifier of a PID interface module. All of it is called at the loop rate, and takes no time to speak of.
pub trait AxisIo {
    /// A sample of the encoder, as [`Feedback::encoder`] says, or why there is none.
    fn sample(&mut self) -> Result<u32, EncoderFault>;
    /// Whether the amplifier says that it is not ready.
    fn amplifier_fault(&mut self) -> bool;
    /// Gives the amplifier a command, -1 to 1, and its enable line.
    fn apply(&mut self, command: f32, enable: bool);
    /// Puts the reset by the watchdog off for another moment.
    fn feed(&mut self);
}

/// What an interrupt does again and again.
pub trait Step: Sync {
    /// Once.
    fn step(&self);
}

/// What the lamps of a board show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Lights {
    /// The network is there.
    pub link: bool,
    /// Something goes over a bus.
    pub bus: bool,
    /// Something is wrong.
    pub fault: bool,
}

/// The lamps of a board.
pub trait Lamps {
    /// Switches each of them on or off.
    fn show(&mut self, lights: Lights);
}

/// How a board is connected to its network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// No cable, or nobody at its other end.
    Down,
    /// Nobody has given the board an address yet.
    NoAddress,
    /// It can be reached.
    Up,
}

/// Flash that keeps the settings over a restart: two pages of [`NorFlash::ERASE_SIZE`] bytes, from offset 0 on. Each
/// word is written once between two erasures. Words that were being written, and pages that were being erased, when the
/// power went may read as anything, but can be read.
pub trait SettingsFlash: NorFlash {}
