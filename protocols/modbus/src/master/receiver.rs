//! Frames out of a line's bytes, in either framing, on the master's side.

use puente_line::Instant;

use super::Outgoing;
use crate::length::{self, Length};
use crate::stream::Stream;
use crate::{BROADCAST, Frame, FrameError, Mode, ascii, function};

#[derive(Clone, Debug)]
pub(super) enum Receiver {
    Rtu(Stream),
    Ascii {
        decoder: ascii::Decoder,
        tail: Tail,
        /// Characters that belonged to no frame.
        garbage: u32,
    },
}

/// The ASCII characters since the last frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum Tail {
    /// There are none.
    Clean,
    /// They are no frame, and nothing has been said about them.
    Untold,
    /// The decoder said why they are no frame.
    Told,
}

impl Receiver {
    pub const fn new(mode: Mode) -> Self {
        match mode {
            Mode::Rtu => Self::Rtu(Stream::new()),
            Mode::Ascii => Self::Ascii { decoder: ascii::Decoder::new(), tail: Tail::Clean, garbage: 0 },
        }
    }

    /// Takes a byte; gives a frame, or why characters were none. [`Receiver::next`] may have more.
    pub fn push(&mut self, now: Instant, byte: u8, request: &Outgoing) -> Option<Result<Frame, FrameError>> {
        match self {
            Self::Rtu(stream) => {
                stream.push(byte);
                self.next(request)
            }
            Self::Ascii { decoder, tail, garbage } => {
                let length = decoder.pending() as u32 + 1;
                *garbage = garbage.wrapping_add(1);
                // Most characters end nothing: no frame is moved for them.
                let Some(result) = decoder.push(now, byte) else {
                    *tail = match (byte, *tail) {
                        (b':', _) | (_, Tail::Clean) => Tail::Untold,
                        (_, tail) => tail,
                    };
                    return None;
                };
                *tail = match &result {
                    Ok(_) => Tail::Clean,
                    Err(_) => Tail::Told,
                };
                if result.is_ok() {
                    *garbage = garbage.wrapping_sub(length);
                }
                Some(result)
            }
        }
    }

    /// The line has been silent: ask [`Receiver::next`], then [`Receiver::damage`].
    pub fn silence(&mut self) {
        if let Self::Rtu(stream) = self {
            stream.silence();
        }
    }

    /// Whether a silence would tell anything new.
    pub fn is_unsettled(&self) -> bool {
        match self {
            Self::Rtu(stream) => stream.is_unsettled(),
            Self::Ascii { .. } => false,
        }
    }

    /// The next frame of those that the last byte or silence has made certain.
    pub fn next(&mut self, request: &Outgoing) -> Option<Result<Frame, FrameError>> {
        match self {
            Self::Rtu(stream) => stream.next(|adu| lengths(request, adu)).map(Ok),
            Self::Ascii { .. } => None,
        }
    }

    /// What was wrong with the bytes before the last silence.
    pub fn damage(&mut self) -> Option<FrameError> {
        match self {
            Self::Rtu(stream) => stream.damage(),
            Self::Ascii { tail: tail @ Tail::Untold, .. } => {
                *tail = Tail::Told;
                Some(FrameError::TooShort)
            }
            Self::Ascii { .. } => None,
        }
    }

    /// Forgets everything but the count of garbage.
    pub fn clear(&mut self) {
        match self {
            Self::Rtu(stream) => stream.clear(),
            Self::Ascii { decoder, tail, .. } => {
                *decoder = ascii::Decoder::new();
                *tail = Tail::Clean;
            }
        }
    }

    /// Bytes that belonged to no frame, modulo 2^32.
    pub fn garbage(&self) -> u32 {
        match self {
            Self::Rtu(stream) => stream.garbage(),
            Self::Ascii { garbage, .. } => *garbage,
        }
    }
}

/// Lengths that the PDU of a frame may have: as a reply, and as our own request, which some adapters echo.
fn lengths(request: &Outgoing, adu: &[u8]) -> [Length; 2] {
    let own = match adu {
        [] => false,
        _ => adu.iter().zip(&request.adu).all(|(received, sent)| received == sent),
    };
    let reply = match adu {
        [] => Length::More,
        [BROADCAST, ..] => Length::Never,
        // A reply to Diagnostics is as long as its request.
        [unit, function::DIAGNOSTICS, ..]
            if *unit == request.unit && request.pdu.first() == Some(&function::DIAGNOSTICS) =>
        {
            Length::Known(request.pdu.len())
        }
        [_, pdu @ ..] => length::reply(pdu),
    };
    [reply, if own && !request.pdu.is_empty() { Length::Known(request.pdu.len()) } else { Length::Never }]
}
