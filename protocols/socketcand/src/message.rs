//! What the server says.

use core::fmt::Write;

use puente_canopen::{Frame, frame};

use crate::request::Name;
use crate::texts::Text;
use crate::words::{self, decimal, hexadecimal, words};

/// A message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message<'a> {
    /// `hi`: the server is there.
    Hi,
    /// `ok`: it is done.
    Ok,
    /// `error TEXT`: why it is not. Its first word is no three hexadecimal digits.
    Error(&'a str),
    /// `frame ID SECONDS.MICROS DATA`: a frame that was on the bus. socketcand has no remote frames.
    Frame {
        /// The frame.
        frame: Frame,
        /// When, in microseconds since 1970 or since the start of the server.
        micros: u64,
    },
    /// `error CLASS SECONDS.MICROS DATA`: an error frame of SocketCAN.
    BusError {
        /// The bits of its classes (`linux/can/error.h`).
        class: u32,
        /// As of a frame.
        micros: u64,
    },
    /// `echo`.
    Echo,
    /// `stat RECEIVED_BYTES RECEIVED_FRAMES SENT_BYTES SENT_FRAMES`.
    Statistics {
        /// Data bytes received.
        received_bytes: u32,
        /// Frames received.
        received: u32,
        /// Data bytes sent.
        sent_bytes: u32,
        /// Frames sent.
        sent: u32,
    },
}

/// A text that is no message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadMessage;

impl<'a> Message<'a> {
    /// What a server says to an `open` that fails.
    pub const NO_BUS: Message<'static> = Message::Error("could not open bus");
    /// What it says to a text that is no request.
    pub const UNKNOWN: Message<'static> = Message::Error("unknown command");

    /// Reads a text without its brackets.
    pub fn parse(text: &'a [u8]) -> Result<Self, BadMessage> {
        Self::read(text).ok_or(BadMessage)
    }

    fn read(text: &'a [u8]) -> Option<Self> {
        let mut words = words(text);
        let verb = words.next()?;
        let message = match verb {
            b"hi" => Self::Hi,
            b"ok" => Self::Ok,
            b"echo" => Self::Echo,
            b"frame" => {
                let id = words::id(words.next()?)?;
                let micros = micros(words.next()?)?;
                let frame =
                    Frame::new(id, data(words.next().unwrap_or_default(), &mut [0; frame::MAX_DATA])?)?;
                Self::Frame { frame, micros }
            }
            b"error" => return error(text),
            b"stat" => {
                let mut number = || decimal(words.next()?);
                Self::Statistics {
                    received_bytes: number()?,
                    received: number()?,
                    sent_bytes: number()?,
                    sent: number()?,
                }
            }
            _ => return None,
        };
        words.next().is_none().then_some(message)
    }

    /// The text, with its brackets; `None` for a remote frame, which the protocol does not have, and for an error that is too
    /// long.
    pub fn emit(&self) -> Option<Text> {
        let mut text = Text::new();
        match *self {
            Self::Hi => write!(text, "< hi >"),
            Self::Ok => write!(text, "< ok >"),
            Self::Error(why) => write!(text, "< error {why} >"),
            Self::Frame { frame, .. } if frame.is_remote() => return None,
            Self::Frame { frame, micros } => {
                write!(text, "< frame {} {} ", Name(frame.id()), Stamp(micros)).ok()?;
                for byte in frame.data() {
                    write!(text, "{byte:02X}").ok()?;
                }
                // python-can wants the data to be a word, even where there are none.
                write!(text, " >")
            }
            Self::BusError { class, micros } => write!(text, "< error {class:03X} {} >", Stamp(micros)),
            Self::Echo => write!(text, "< echo >"),
            Self::Statistics { received_bytes, received, sent_bytes, sent } => {
                write!(text, "< stat {received_bytes} {received} {sent_bytes} {sent} >")
            }
        }
        .ok()?;
        Some(text)
    }
}

/// Bytes as digits without spaces between them.
fn data<'a>(digits: &[u8], place: &'a mut [u8; frame::MAX_DATA]) -> Option<&'a [u8]> {
    if !digits.len().is_multiple_of(2) {
        return None;
    }
    let place = place.get_mut(..digits.len() / 2)?;
    for (byte, digits) in place.iter_mut().zip(digits.chunks(2)) {
        *byte = words::byte(digits)?;
    }
    Some(place)
}

fn error(text: &[u8]) -> Option<Message<'_>> {
    let mut after = words(text).skip(1);
    if let (Some(class), Some(stamp)) = (after.next().and_then(hexadecimal), after.next().and_then(micros)) {
        return Some(Message::BusError { class, micros: stamp });
    }
    let text = core::str::from_utf8(text).ok()?.trim();
    Some(Message::Error(text.strip_prefix("error")?.trim_start()))
}

/// Seconds, a point, and six digits of microseconds.
fn micros(word: &[u8]) -> Option<u64> {
    let point = word.iter().position(|byte| *byte == b'.')?;
    let (seconds, rest) = word.split_at_checked(point)?;
    let (_, micros) = rest.split_first()?;
    if micros.len() != 6 {
        return None;
    }
    Some(u64::from(decimal(seconds)?) * 1_000_000 + u64::from(decimal(micros)?))
}

struct Stamp(u64);

impl core::fmt::Display for Stamp {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}.{:06}", self.0 / 1_000_000, self.0 % 1_000_000)
    }
}
