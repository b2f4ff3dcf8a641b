//! What goes into a master and comes out of it.

use core::fmt;
use core::time::Duration;

use puente_line::Settings;

use crate::{Exception, FrameError, Mode};

/// How a master works its line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Baud rate and format; the silences and wire times follow from them.
    pub line: Settings,
    /// Framing.
    pub mode: Mode,
    /// Silence before a request, where slaves want more than the standard's: t3.5 in RTU.
    pub silence: Duration,
    /// From the end of a request to the end of its reply. A reply that is still arriving then is waited for, for at most the
    /// wire time of the longest frame.
    pub reply_timeout: Duration,
    /// Silence after a broadcast, in which the slaves carry it out.
    pub turnaround: Duration,
    /// Least time from a slave's reply to the next request to the same slave; kept in whole milliseconds, rounded up.
    pub rest: Duration,
    /// So long after its deadline a slave that has not answered is not addressed, unless its late reply is seen; in whole
    /// milliseconds, rounded up.
    pub quarantine: Duration,
    /// What to do with the echo of what is sent.
    pub echo: Echo,
}

impl Config {
    /// For a line: the standard's silence, 500 ms for a reply, 100 ms of turnaround, no rest, 500 ms of quarantine, no echo.
    pub const fn new(mode: Mode, line: Settings) -> Self {
        Self {
            line,
            mode,
            silence: Duration::ZERO,
            reply_timeout: Duration::from_millis(500),
            turnaround: Duration::from_millis(100),
            rest: Duration::ZERO,
            quarantine: Duration::from_millis(500),
            echo: Echo::Off,
        }
    }
}

/// What a two-wire adapter that hears itself adds to the bytes received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Echo {
    /// There is no echo. If there is one, the echo of a read is not taken for its reply, but counted
    /// ([`Counters::echoes`]). The echo of a request whose reply repeats it (05, 06, 08, 16 and opaque functions) cannot be
    /// told from that reply, so that such a line must not be left at `Off`.
    Off,
    /// As many bytes as were sent are removed unseen.
    Strip,
    /// The bytes sent must come back. If they do not, something else talks on the line and the transaction ends.
    Verify,
}

/// The outcome of the last request has not been fetched yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy;

impl fmt::Display for Busy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the master has a request in work")
    }
}

impl core::error::Error for Busy {}

/// What the caller has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action<'a> {
    /// Send these bytes, now and without a pause.
    Transmit(&'a [u8]),
    /// The request is done.
    Done(Outcome<'a>),
    /// Nothing until more bytes or the time of [`crate::Master::poll_at`].
    Idle,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome<'a> {
    /// The PDU of its reply, which may be an exception.
    Reply(&'a [u8]),
    /// It was sent to all; none answers.
    Broadcast,
    /// No reply came. It was sent, unless the evidence is [`Evidence::Malformed`].
    NoReply(Evidence),
}

/// Why the last bytes seen were no reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// No byte came.
    Silence,
    /// The CRC or LRC did not hold.
    Check {
        /// The check computed over what came.
        expected: u16,
        /// The check that came.
        received: u16,
    },
    /// Bytes that were no frame for another reason; `TooShort` for one cut off.
    Damaged(FrameError),
    /// A valid frame of another unit.
    WrongUnit {
        /// Addressed.
        expected: u8,
        /// In the frame.
        received: u8,
    },
    /// A valid frame of the unit with another function.
    WrongFunction {
        /// Of the request.
        expected: u8,
        /// In the frame.
        received: u8,
    },
    /// A valid frame of the unit and function with another length or byte count.
    WrongLength {
        /// PDU bytes that the request calls for.
        expected: u16,
        /// PDU bytes of the frame, or those that its byte count stands for.
        received: u16,
    },
    /// A valid frame of the unit and function that repeats another address, value or quantity.
    WrongField {
        /// In the request.
        expected: u16,
        /// In the frame.
        received: u16,
    },
    /// Parity, framing or overrun errors.
    Line,
    /// The request itself came back, though [`Echo::Off`] says that there is no echo.
    Echo,
    /// [`Echo::Strip`], [`Echo::Verify`]: the request did not come back whole, so it may not have been sent.
    EchoMissing,
    /// [`Echo::Verify`]: another byte came back than was sent.
    EchoDiffers {
        /// Sent.
        expected: u8,
        /// Come back.
        received: u8,
    },
    /// The request was not sent: this is what a server would answer to it.
    Malformed(Exception),
}

impl fmt::Display for Evidence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silence => f.write_str("no byte came"),
            Self::Check { expected, received } => {
                write!(f, "{}", FrameError::Check { expected: *expected, received: *received })
            }
            Self::Damaged(error) => write!(f, "{error}"),
            Self::WrongUnit { expected, received } => {
                write!(f, "a frame of unit {received} came instead of {expected}")
            }
            Self::WrongFunction { expected, received } => {
                write!(f, "function {received:02X}h came instead of {expected:02X}h")
            }
            Self::WrongLength { expected, received } => {
                write!(f, "a PDU of {received} bytes came instead of {expected}")
            }
            Self::WrongField { expected, received } => {
                write!(f, "{received:04X}h was repeated instead of {expected:04X}h")
            }
            Self::Line => f.write_str("parity, framing or overrun errors"),
            Self::Echo => f.write_str("only the request itself came back"),
            Self::EchoMissing => f.write_str("the echo of the request did not come back whole"),
            Self::EchoDiffers { expected, received } => {
                write!(f, "{received:02X}h was echoed instead of {expected:02X}h")
            }
            Self::Malformed(exception) => write!(f, "the request is malformed: {exception}"),
        }
    }
}

/// Events since start-up, each modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Requests sent.
    pub requests: u32,
    /// Normal replies delivered.
    pub replies: u32,
    /// Exception replies delivered.
    pub exceptions: u32,
    /// Requests that ended without a reply.
    pub timeouts: u32,
    /// Frames or bursts that were damaged: check, digits or length.
    pub check_errors: u32,
    /// Valid frames of another unit than the one waited for.
    pub wrong_unit: u32,
    /// Valid frames of the unit waited for with another function.
    pub wrong_function: u32,
    /// Valid frames of the unit and function waited for with another length, byte count or repeated field.
    pub wrong_length: u32,
    /// Valid frames of a unit whose reply had been given up, or that came when nothing was waited for.
    pub late: u32,
    /// Own requests heard that were neither stripped nor verified: with any, set [`Echo::Strip`].
    pub echoes: u32,
    /// Bytes that belonged to no valid frame.
    pub garbage_bytes: u32,
    /// Parity, framing and overrun errors.
    pub line_errors: u32,
}
