//! ASCII frames: `:`, unit, PDU and LRC as hexadecimal pairs, CR LF (serial line V1.02, clause 2.5.2).

use core::time::Duration;

use puente_line::Instant;

use crate::lrc::lrc;
use crate::{Frame, FrameError, MAX_PDU, Pdu};

/// Characters of the longest frame, from `:` to LF.
pub const MAX_ADU: usize = 513;

/// Characters of a frame beside the two for each byte of its PDU: colon, unit, LRC, CR and LF.
pub(crate) const OVERHEAD: usize = 7;
/// Longest time between two characters of a frame (clause 2.5.2.1).
pub const CHARACTER_TIMEOUT: Duration = Duration::from_secs(1);

/// Bytes that the longest frame carries: unit, PDU, LRC.
const MAX_BYTES: usize = 1 + MAX_PDU + 1;

type Bytes = heapless::Vec<u8, MAX_BYTES>;

/// A frame in upper case; empty where the PDU is empty or longer than [`MAX_PDU`], so that nothing wrong gets onto a line.
pub fn emit(unit: u8, pdu: &[u8]) -> heapless::Vec<u8, MAX_ADU> {
    let mut adu = heapless::Vec::new();
    write(&mut adu, unit, pdu);
    adu
}

/// Writes a frame into an empty vector.
pub(crate) fn write(adu: &mut heapless::Vec<u8, MAX_ADU>, unit: u8, pdu: &[u8]) {
    if !(1..=MAX_PDU).contains(&pdu.len()) {
        return;
    }
    let check = lrc(pdu).wrapping_sub(unit);
    // At most 1 + 2 * MAX_BYTES + 2 = MAX_ADU characters, so that nothing is refused.
    let _ = adu.push(b':');
    for byte in core::iter::once(&unit).chain(pdu).chain(core::iter::once(&check)) {
        let _ = adu.extend_from_slice(&[digit(byte >> 4), digit(byte & 0x0F)]);
    }
    let _ = adu.extend_from_slice(b"\r\n");
}

/// A frame from `:` on, with or without its CR LF. Digits of either case.
///
/// # Errors
/// Any [`FrameError`].
pub fn parse(adu: &[u8]) -> Result<Frame, FrameError> {
    let adu = adu.strip_suffix(b"\n").unwrap_or(adu);
    let adu = adu.strip_suffix(b"\r").unwrap_or(adu);
    let mut decoder = Decoder::new();
    let Some(digits) = adu.strip_prefix(b":") else {
        return Err(FrameError::NotHex { at: 0 });
    };
    decoder.push(Instant::ZERO, b':');
    for &character in digits {
        match character {
            b':' | b'\r' | b'\n' => return Err(FrameError::NotHex { at: decoder.at }),
            _ => {
                if let Some(result) = decoder.push(Instant::ZERO, character) {
                    return result;
                }
            }
        }
    }
    decoder.finish()
}

/// Finds frames in the characters of a line.
///
/// `:` starts a frame at any time, whatever was before it. LF ends one; a CR before it is asked for by the specification but
/// not insisted on, since the LRC already tells a cut frame. Characters between frames are passed over.
#[derive(Clone, Debug)]
pub struct Decoder {
    state: State,
    bytes: Bytes,
    /// Position of the next character in the frame.
    at: u16,
    last: Instant,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// Before a `:`.
    Hunting,
    /// The next digit is the first of a pair.
    High,
    /// The next digit is the second of a pair.
    Low { high: u8 },
    /// After CR.
    End { odd: bool },
}

impl Decoder {
    /// A decoder that waits for `:`.
    pub const fn new() -> Self {
        Self { state: State::Hunting, bytes: Bytes::new(), at: 0, last: Instant::ZERO }
    }

    /// Takes a character; gives a frame, or why there is none, at once when that is certain.
    ///
    /// A frame whose characters pause for more than [`CHARACTER_TIMEOUT`] is dropped without a word.
    pub fn push(&mut self, now: Instant, character: u8) -> Option<Result<Frame, FrameError>> {
        if now.since(self.last) > CHARACTER_TIMEOUT {
            self.state = State::Hunting;
        }
        self.last = now;
        match (self.state, character) {
            (_, b':') => {
                self.bytes.clear();
                self.at = 1;
                self.state = State::High;
                return None;
            }
            (State::Hunting, _) => return None,
            (_, b'\n') => return Some(self.finish()),
            (State::High, b'\r') => self.state = State::End { odd: false },
            (State::Low { .. }, b'\r') => self.state = State::End { odd: true },
            (state, _) => {
                if let Err(error) = self.digit(state, character) {
                    self.state = State::Hunting;
                    return Some(Err(error));
                }
            }
        }
        self.at += 1;
        None
    }

    /// Characters of the frame that is under way, `:` included; 0 between frames.
    pub fn pending(&self) -> usize {
        match self.state {
            State::Hunting => 0,
            _ => usize::from(self.at),
        }
    }

    fn digit(&mut self, state: State, character: u8) -> Result<(), FrameError> {
        let value = value(character).ok_or(FrameError::NotHex { at: self.at })?;
        self.state = match state {
            State::High => State::Low { high: value },
            State::Low { high } => {
                self.bytes.push(high << 4 | value).map_err(|_| FrameError::TooLong)?;
                State::High
            }
            State::Hunting | State::End { .. } => return Err(FrameError::NotHex { at: self.at }),
        };
        Ok(())
    }

    fn finish(&mut self) -> Result<Frame, FrameError> {
        let state = core::mem::replace(&mut self.state, State::Hunting);
        if matches!(state, State::Low { .. } | State::End { odd: true }) {
            return Err(FrameError::OddDigits);
        }
        let [unit, pdu @ .., check] = self.bytes.as_slice() else {
            return Err(FrameError::TooShort);
        };
        if pdu.is_empty() {
            return Err(FrameError::TooShort);
        }
        let expected = lrc(pdu).wrapping_sub(*unit);
        if *check != expected {
            return Err(FrameError::Check { expected: expected.into(), received: (*check).into() });
        }
        let pdu = Pdu::from_slice(pdu).map_err(|_| FrameError::TooLong)?;
        Ok(Frame { unit: *unit, pdu })
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

const fn digit(nibble: u8) -> u8 {
    match nibble {
        0..=9 => b'0' + nibble,
        _ => b'A' + nibble - 10,
    }
}

const fn value(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'A'..=b'F' => Some(digit - b'A' + 10),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}
