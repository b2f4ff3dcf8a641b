//! CAN frames as text, as a microcontroller of a thesis has them on its serial line: `ID, length, data`, the identifier and the
//! data in hex.
//!
//! - *Controller mode*: `:602,8,40-41-60-00-00-00-00-00` and a carriage return.
//! - *Bridge mode*: the same between `=` and `X`.
//!
//! The document says the form ("formato adoptado: `: ID, longitud de datos, datos (hex)`") and what begins and ends a message
//! (section 5.1), and prints sessions (section 6.4) with spaces after the commas, and with en dashes, hyphens or nothing between
//! the bytes. All of it is read; what is written is one form.
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]

use core::fmt;

use puente_canopen::frame::{MAX_BASE, MAX_DATA, MAX_EXTENDED};
use puente_canopen::{Frame, Id};

/// In which of the two forms a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// From `:` to a carriage return.
    Controller,
    /// From `=` to `X`.
    Bridge,
}

impl Mode {
    /// The mode of a message by its first byte; `None` for another.
    pub const fn of(first: u8) -> Option<Self> {
        match first {
            b':' => Some(Self::Controller),
            b'=' => Some(Self::Bridge),
            _ => None,
        }
    }

    /// What begins a message.
    pub const fn begin(self) -> char {
        match self {
            Self::Controller => ':',
            Self::Bridge => '=',
        }
    }

    /// What ends a message. In bridge mode nothing else has to; the line is ended as well, for those who read lines.
    pub const fn end(self) -> &'static str {
        match self {
            Self::Controller => "\r\n",
            Self::Bridge => "X\r\n",
        }
    }
}

/// Why a text is no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// There are no three parts, with commas between.
    Parts,
    /// The identifier is no hex number up to 1FFFFFFF.
    Id,
    /// The length is no number from 0 to 8.
    Length,
    /// The data are no pairs of hex digits.
    Data,
    /// There are more or fewer bytes than were said.
    Count {
        /// So many were said.
        said: u8,
        /// So many are there; 9 for more than 8.
        found: u8,
    },
}

impl Mistake {
    /// A word for it.
    pub const fn code(self) -> &'static str {
        match self {
            Self::Parts => "frame",
            Self::Id => "frame-id",
            Self::Length => "frame-length",
            Self::Data | Self::Count { .. } => "frame-data",
        }
    }
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Parts => f.write_str("a frame is ID,length,data, as 602,8,40-41-60-00-00-00-00-00"),
            Self::Id => f.write_str("an identifier is a hex number, 0 to 7FF; longer ones to 1FFFFFFF"),
            Self::Length => f.write_str("a length is a number from 0 to 8"),
            Self::Data => f.write_str("data are bytes of two hex digits, with or without hyphens between"),
            Self::Count { said, found } => write!(f, "the length is {said}, and the bytes are {found}"),
        }
    }
}

impl core::error::Error for Mistake {}

/// The frame in a message without what begins and ends it. A longer identifier than 7FF, or one of eight digits, is an
/// extended one. `R` in place of the data is a remote frame; the document has none.
///
/// # Errors
/// What is wrong with it.
pub fn parse(text: &[u8]) -> Result<Frame, Mistake> {
    let mut parts = text.splitn(3, |byte| *byte == b',').map(<[u8]>::trim_ascii);
    let (Some(id), Some(length)) = (parts.next(), parts.next()) else {
        return Err(Mistake::Parts);
    };
    let data = parts.next().unwrap_or_default();
    let id = id_of(id).ok_or(Mistake::Id)?;
    let length = match length {
        [digit @ b'0'..=b'8'] | [b'0', digit @ b'0'..=b'8'] => digit - b'0',
        _ => return Err(Mistake::Length),
    };
    if matches!(data, b"R" | b"r") {
        return Ok(Frame::remote(id, length));
    }
    let mut bytes = [0; MAX_DATA];
    let found = bytes_of(data, &mut bytes)?;
    if found != usize::from(length) {
        return Err(Mistake::Count { said: length, found: found as u8 });
    }
    let whole = bytes.get(..found).and_then(|bytes| Frame::new(id, bytes));
    whole.ok_or(Mistake::Data)
}

fn id_of(text: &[u8]) -> Option<Id> {
    let digits = text.strip_prefix(b"0x").unwrap_or(text);
    if !(1..=8).contains(&digits.len()) {
        return None;
    }
    let number =
        digits.iter().try_fold(0u32, |number, digit| Some(number << 4 | char::from(*digit).to_digit(16)?))?;
    match number {
        _ if number <= u32::from(MAX_BASE) && digits.len() < 8 => Some(Id::base(number as u16)),
        _ if number <= MAX_EXTENDED => Some(Id::extended(number)),
        _ => None,
    }
}

/// What may stand between two bytes: a hyphen, or what word processors make of one, in UTF-8 and in code page 1252.
const DASHES: [&[u8]; 7] =
    [b"-", "‐".as_bytes(), "–".as_bytes(), "—".as_bytes(), "−".as_bytes(), b"\x96", b"\x97"];

/// Reads bytes; gives how many there are, 9 for more than 8.
fn bytes_of(mut text: &[u8], bytes: &mut [u8; MAX_DATA]) -> Result<usize, Mistake> {
    let mut found = 0;
    while let Some((first, rest)) = text.split_first() {
        if first.is_ascii_whitespace() {
            text = rest;
        } else if let Some(rest) = DASHES.iter().find_map(|dash| text.strip_prefix(*dash)) {
            text = rest;
        } else {
            let (Some(high), Some((second, rest))) = (char::from(*first).to_digit(16), rest.split_first())
            else {
                return Err(Mistake::Data);
            };
            let low = char::from(*second).to_digit(16).ok_or(Mistake::Data)?;
            if let Some(byte) = bytes.get_mut(found) {
                *byte = (high << 4 | low) as u8;
            }
            found = (found + 1).min(MAX_DATA + 1);
            text = rest;
        }
    }
    Ok(found)
}

/// A frame as a message: `:582,8,4B-41-60-00-40-02-00-00`, in controller mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message<'f>(pub Mode, pub &'f Frame);

impl fmt::Display for Message<'_> {
    /// The message whole, with its line end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(mode, frame) = self;
        write!(f, "{}", mode.begin())?;
        match frame.id() {
            Id::Base(id) => write!(f, "{id:03X}")?,
            Id::Extended(id) => write!(f, "{id:08X}")?,
        }
        write!(f, ",{},", frame.length())?;
        if frame.is_remote() {
            f.write_str("R")?;
        }
        for (at, byte) in frame.data().iter().enumerate() {
            let dash = if at == 0 { "" } else { "-" };
            write!(f, "{dash}{byte:02X}")?;
        }
        f.write_str(mode.end())
    }
}
