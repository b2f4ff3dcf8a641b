//! What a client says to an adapter.

use puente_canopen::Frame;

use crate::digits;
use crate::lines::Text;
use crate::rate::Rate;

/// A command. It is answered by a [`crate::Reply`] of its own, or by BEL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Nothing: clients send empty lines to find the beginning of the next one. Lawicel's adapters answer CR.
    Nothing,
    /// `Sn`: bit rate. Only while the channel is closed.
    Rate(Rate),
    /// `sXXYY`: bit timing as the registers BTR0 and BTR1 of an SJA1000 at 16 MHz. Only while the channel is closed.
    Timing {
        /// Prescaler and jump width.
        btr0: u8,
        /// Segments.
        btr1: u8,
    },
    /// `O`: opens the channel.
    Open,
    /// `L`: opens the channel to listen only.
    Listen,
    /// `C`: closes the channel.
    Close,
    /// `t`, `T`, `r`, `R`: sends a frame.
    Send(Frame),
    /// `F`: asks for the status flags, which are cleared by that.
    Flags,
    /// `V`: asks for the versions of hardware and software.
    Version,
    /// `N`: asks for the serial number.
    Serial,
    /// `Z1`, `Z0`: time stamps on frames, on or off. Only while the channel is closed.
    Stamps(bool),
    /// `M`: acceptance code, as the registers of an SJA1000. CANable has bus modes under the same letter: `M0` normal, `M1`
    /// silent, with one digit.
    Code(u32),
    /// `m`: acceptance mask, a bit 1 where the frame's is not looked at.
    Mask(u32),
}

/// A line that is no command, or one that this crate does not know. The answer is BEL.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadCommand;

impl Command {
    /// Reads a line without its end. A time stamp at the end of a frame is not looked at.
    pub fn parse(line: &[u8]) -> Result<Self, BadCommand> {
        Self::read(line).ok_or(BadCommand)
    }

    fn read(line: &[u8]) -> Option<Self> {
        let byte = |value: u32, shift: u32| (value >> shift & 0xFF) as u8;
        Some(match *line {
            [] => Self::Nothing,
            [b'S', digit] => Self::Rate(Rate::of_digit(digit)?),
            [b's', ref rest @ ..] if rest.len() == 4 => {
                let value = digits::value(rest)?;
                Self::Timing { btr0: byte(value, 8), btr1: byte(value, 0) }
            }
            [b'O'] => Self::Open,
            [b'L'] => Self::Listen,
            [b'C'] => Self::Close,
            [b'F'] => Self::Flags,
            [b'V'] => Self::Version,
            [b'N'] => Self::Serial,
            [b'Z', b'0'] => Self::Stamps(false),
            [b'Z', b'1'] => Self::Stamps(true),
            [b'M', ref rest @ ..] if rest.len() == 8 => Self::Code(digits::value(rest)?),
            [b'm', ref rest @ ..] if rest.len() == 8 => Self::Mask(digits::value(rest)?),
            _ => match digits::frame(line)? {
                (frame, []) => Self::Send(frame),
                (frame, stamp) if stamp.len() == 4 && digits::value(stamp).is_some() => Self::Send(frame),
                _ => return None,
            },
        })
    }

    /// The line, with its end.
    pub fn emit(&self) -> Text {
        let mut text = Text::new();
        let mut letters = |letters: &[u8]| {
            // The longest line has room.
            let _ = text.extend_from_slice(letters);
        };
        match *self {
            Self::Nothing => {}
            Self::Rate(rate) => letters(&[b'S', rate.digit()]),
            Self::Timing { btr0, btr1 } => {
                letters(b"s");
                digits::push(&mut text, btr0.into(), 2);
                digits::push(&mut text, btr1.into(), 2);
            }
            Self::Open => letters(b"O"),
            Self::Listen => letters(b"L"),
            Self::Close => letters(b"C"),
            Self::Send(frame) => digits::push_frame(&mut text, &frame),
            Self::Flags => letters(b"F"),
            Self::Version => letters(b"V"),
            Self::Serial => letters(b"N"),
            Self::Stamps(on) => letters(if on { b"Z1" } else { b"Z0" }),
            Self::Code(code) => {
                letters(b"M");
                digits::push(&mut text, code, 8);
            }
            Self::Mask(mask) => {
                letters(b"m");
                digits::push(&mut text, mask, 8);
            }
        }
        let _ = text.push(b'\r');
        text
    }
}
