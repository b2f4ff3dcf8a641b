//! What an adapter says.

use puente_canopen::Frame;

use crate::digits;
use crate::lines::{End, Text};

/// A line of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply {
    /// CR: the command was obeyed. CANable's firmware says nothing at all instead.
    Done,
    /// `z` CR for `t` and `r`, `Z` CR for `T` and `R`: the frame was taken. Adapters without automatic polling say CR.
    Taken {
        /// It was an extended one.
        extended: bool,
    },
    /// BEL: the command was not obeyed. To a frame: there is no room for it, or the channel is not open.
    Refused,
    /// A frame that was on the bus.
    Heard {
        /// The frame.
        frame: Frame,
        /// When it was there, in milliseconds of a minute, where time stamps are on.
        stamp: Option<u16>,
    },
    /// `Fxx`.
    Flags(Flags),
    /// `Vhhss`: versions of hardware and software. CANable says a text that begins with V instead, which is no reply here.
    Version {
        /// Of the hardware, as two digits.
        hardware: u8,
        /// Of the software, as two digits.
        software: u8,
    },
    /// `Naaaa`: serial number, four letters or digits.
    Serial([u8; 4]),
    /// `sb000256`: the controller has come to this state. Unasked, by adapters that follow Linux' slcan driver
    /// (`slcan_bump_state`); Lawicel's have flags alone, which do not tell that it is off.
    State {
        /// Which.
        state: BusState,
        /// Receive error counter, to 999.
        rx_errors: u16,
        /// Transmit error counter, to 999.
        tx_errors: u16,
    },
}

/// How a controller takes part in the traffic (fault confinement of ISO 11898-1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusState {
    /// Error-active.
    Active,
    /// An error counter has reached 96.
    Warning,
    /// Error-passive.
    Passive,
    /// Bus-off.
    Off,
}

impl BusState {
    fn of(letter: u8) -> Option<Self> {
        [Self::Active, Self::Warning, Self::Passive, Self::Off]
            .into_iter()
            .find(|state| state.letter() == letter)
    }

    const fn letter(self) -> u8 {
        match self {
            Self::Active => b'a',
            Self::Warning => b'w',
            Self::Passive => b'p',
            Self::Off => b'b',
        }
    }
}

/// A line that is no reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadReply;

/// Status flags, which are those of an SJA1000 (Lawicel, as remembered).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags(pub u8);

impl Flags {
    /// The queue of received frames is full.
    pub const RECEIVE_FULL: u8 = 1 << 0;
    /// The queue of frames to send is full.
    pub const SEND_FULL: u8 = 1 << 1;
    /// Error warning: a counter has reached 96, or the controller is bus-off.
    pub const WARNING: u8 = 1 << 2;
    /// A received frame was lost.
    pub const OVERRUN: u8 = 1 << 3;
    /// Error-passive.
    pub const PASSIVE: u8 = 1 << 5;
    /// Arbitration lost.
    pub const ARBITRATION: u8 = 1 << 6;
    /// Bus error.
    pub const BUS_ERROR: u8 = 1 << 7;

    /// Whether one of these flags is set.
    pub const fn any(self, flags: u8) -> bool {
        self.0 & flags != 0
    }
}

impl Reply {
    /// Reads a line without its end. Where BEL ends it, what stands before it does not count.
    pub fn parse(end: End, line: &[u8]) -> Result<Self, BadReply> {
        match end {
            End::Bell => Ok(Self::Refused),
            End::Return => Self::read(line).ok_or(BadReply),
        }
    }

    fn read(line: &[u8]) -> Option<Self> {
        Some(match *line {
            [] => Self::Done,
            [b'z'] => Self::Taken { extended: false },
            [b'Z'] => Self::Taken { extended: true },
            [b'F', ref rest @ ..] if rest.len() == 2 => Self::Flags(Flags(digits::value(rest)? as u8)),
            [b'V', ref rest @ ..] if rest.len() == 4 => {
                let value = digits::value(rest)?;
                Self::Version { hardware: (value >> 8) as u8, software: value as u8 }
            }
            [b's', letter, ref counters @ ..] if counters.len() == 6 => {
                let (rx_errors, tx_errors) = counters.split_at(3);
                let [rx_errors, tx_errors] = [rx_errors, tx_errors].map(digits::decimal);
                Self::State { state: BusState::of(letter)?, rx_errors: rx_errors?, tx_errors: tx_errors? }
            }
            [b'N', a, b, c, d] => {
                let serial = [a, b, c, d];
                serial.iter().all(u8::is_ascii_alphanumeric).then_some(Self::Serial(serial))?
            }
            _ => match digits::frame(line)? {
                (frame, []) => Self::Heard { frame, stamp: None },
                (frame, stamp) if stamp.len() == 4 => {
                    Self::Heard { frame, stamp: Some(digits::value(stamp)? as u16) }
                }
                _ => return None,
            },
        })
    }

    /// The line, with its end. A serial number with characters that are none of it gets zeros for them.
    pub fn emit(&self) -> Text {
        let mut text = Text::new();
        match *self {
            Self::Done => {}
            Self::Taken { extended } => {
                let _ = text.push(if extended { b'Z' } else { b'z' });
            }
            Self::Refused => {
                let _ = text.push(0x07);
                return text;
            }
            Self::Heard { frame, stamp } => {
                digits::push_frame(&mut text, &frame);
                if let Some(stamp) = stamp {
                    digits::push(&mut text, stamp.into(), 4);
                }
            }
            Self::Flags(Flags(flags)) => {
                let _ = text.push(b'F');
                digits::push(&mut text, flags.into(), 2);
            }
            Self::Version { hardware, software } => {
                let _ = text.push(b'V');
                digits::push(&mut text, hardware.into(), 2);
                digits::push(&mut text, software.into(), 2);
            }
            Self::Serial(serial) => {
                let _ = text.push(b'N');
                let letters = serial.map(|letter| if letter.is_ascii_alphanumeric() { letter } else { b'0' });
                let _ = text.extend_from_slice(&letters);
            }
            Self::State { state, rx_errors, tx_errors } => {
                let _ = text.extend_from_slice(&[b's', state.letter()]);
                digits::push_decimal(&mut text, rx_errors);
                digits::push_decimal(&mut text, tx_errors);
            }
        }
        let _ = text.push(b'\r');
        text
    }
}
