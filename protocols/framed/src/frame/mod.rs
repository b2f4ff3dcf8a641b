//! Frames: their checks, their kinds, and the bytes of both. The crate's page has the layout.

mod error;
mod kind;

pub use error::{EmitError, FrameError};
pub use kind::{Class, Kind, Reason, Session};

use crate::section::{self, Section, Sections};

/// First byte of every frame.
pub const PREAMBLE: u8 = 0x7E;
/// Last byte of every frame.
pub const TERMINATOR: u8 = 0x0A;
/// Bytes of a frame besides its packet.
pub const OVERHEAD: usize = HEADER + 2;
/// Bytes of the shortest packet of the thesis.
pub const MIN_PACKET: usize = 45;
/// Bytes of the longest packet: six sections of 255.
pub const MAX_PACKET: usize = 1530;
/// Bytes of the longest frame.
pub const MAX_FRAME: usize = MAX_PACKET + OVERHEAD;
/// Bytes of the section that ends the packet of a tagged frame.
pub const TRAILER: usize = section::OVERHEAD + TRAILER_DATA as usize;
/// Bytes of a tagged frame besides its sections.
pub const TAGGED_OVERHEAD: usize = OVERHEAD + TRAILER;

/// Preamble, origin, tag and length.
pub const HEADER: usize = 4;
/// Detail, session, CRC.
const TRAILER_DATA: u8 = 10;
/// Bytes after the last that the CRC covers: the CRC, TMR, LRC, terminator.
const AFTER_COVERED: usize = 7;
/// The shortest tagged packet: one section without data, and the trailer.
const MIN_TAGGED: usize = section::OVERHEAD + TRAILER;
/// The bits of the length that are a length.
const LENGTH: u16 = 0x07FF;
const TAG_SHIFT: u32 = 11;
/// The tag's bit of a frame of a window.
const WINDOW: u8 = 0x10;

/// A table of 1 KB: a byte per look-up.
static CRC: crc::Crc<u32, crc::Table<1>> = crc::Crc::<u32, crc::Table<1>>::new(&crc::CRC_32_ISCSI);

/// The two's complement of the sum of `bytes` modulo 256.
pub fn lrc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_sub(*byte))
}

/// A frame whose checks held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Address of the station that sent it.
    pub origin: u8,
    /// What it is.
    pub kind: Kind,
    /// Its sections, without the trailer.
    pub body: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Its sections, without the trailer.
    pub const fn sections(&self) -> Sections<'a> {
        Sections::new(self.body)
    }

    /// The station of its first section; of a tagged frame its destination.
    pub fn destination(&self) -> u8 {
        self.body.first().copied().unwrap_or(section::NOBODY)
    }

    /// What it says to `station`.
    pub fn section_for(&self, station: u8) -> Option<Section<'a>> {
        self.sections().find(|section| section.address == station)
    }
}

/// Bytes of the frame that begins with `header`.
///
/// # Errors
/// `Preamble`, `Tag`, `Length`.
pub fn announced(header: [u8; HEADER]) -> Result<usize, FrameError> {
    let [preamble, _, high, low] = header;
    if preamble != PREAMBLE {
        return Err(FrameError::Preamble { received: preamble });
    }
    let (tag, length) = split(high, low);
    let least = match tag {
        0 => MIN_PACKET,
        8..WINDOW => return Err(FrameError::Tag { received: tag }),
        _ => MIN_TAGGED,
    };
    if (least..=MAX_PACKET).contains(&usize::from(length)) {
        Ok(usize::from(length) + OVERHEAD)
    } else {
        Err(FrameError::Length { received: length })
    }
}

const fn split(high: u8, low: u8) -> (u8, u16) {
    let word = u16::from_be_bytes([high, low]);
    ((word >> TAG_SHIFT) as u8, word & LENGTH)
}

/// The frame that `bytes` are.
///
/// # Errors
/// Any [`FrameError`].
pub fn parse(bytes: &[u8]) -> Result<Frame<'_>, FrameError> {
    let (&header, rest) = bytes.split_first_chunk().ok_or(FrameError::Size)?;
    if announced(header)? != bytes.len() {
        return Err(FrameError::Size);
    }
    let (packet, &[check, terminator]) = rest.split_last_chunk().ok_or(FrameError::Size)?;
    if terminator != TERMINATOR {
        return Err(FrameError::Terminator { received: terminator });
    }
    let expected = lrc(packet);
    if check != expected {
        return Err(FrameError::Lrc { expected, received: check });
    }
    let mut sections = Sections::new(packet);
    let last = sections.by_ref().last();
    if !sections.rest().is_empty() {
        return Err(FrameError::Sections);
    }
    let [_, origin, high, low] = header;
    let (kind, body) = match (split(high, low).0, last.filter(is_trailer)) {
        (0, None) => (Kind::Plain, packet),
        (tag @ 1.., Some(trailer)) => {
            let kind = tagged(tag, bytes, trailer.data)?;
            (kind, packet.get(..packet.len() - TRAILER).unwrap_or_default())
        }
        _ => return Err(FrameError::Trailer),
    };
    if kind != Kind::Plain && Sections::new(body).any(|section| section.terminator != section::TERMINATOR) {
        return Err(FrameError::Sections);
    }
    Ok(Frame { origin, kind, body })
}

fn is_trailer(last: &Section<'_>) -> bool {
    last.address == section::TRAILER
        && last.data.len() == usize::from(TRAILER_DATA)
        && last.terminator == section::TERMINATOR
}

fn tagged(tag: u8, frame: &[u8], trailer: &[u8]) -> Result<Kind, FrameError> {
    let &[d0, d1, s0, s1, s2, s3, c0, c1, c2, c3] = trailer else {
        return Err(FrameError::Trailer);
    };
    let received = u32::from_be_bytes([c0, c1, c2, c3]);
    let covered = frame.get(1..frame.len().saturating_sub(AFTER_COVERED)).unwrap_or_default();
    let expected = CRC.checksum(covered);
    if received != expected {
        return Err(FrameError::Crc { expected, received });
    }
    Kind::from_parts(tag, [d0, d1], Session::from_bytes([s0, s1, s2, s3])).ok_or(FrameError::Trailer)
}

/// Puts a frame into `buffer`, in place of what is there. `body` is its sections, see [`section::push`]; a plain frame is
/// filled up to [`MIN_PACKET`] by a section for nobody.
///
/// # Errors
/// Any [`EmitError`]; `buffer` is empty then.
pub fn emit<const N: usize>(
    buffer: &mut heapless::Vec<u8, N>,
    origin: u8,
    kind: Kind,
    body: &[u8],
) -> Result<(), EmitError> {
    build(buffer, origin, kind, |buffer| append(buffer, body))
}

/// The same, with sections that `write` appends to what is already in `buffer`.
///
/// # Errors
/// Any [`EmitError`], what `write` says among them; `buffer` is empty then.
pub fn build<const N: usize>(
    buffer: &mut heapless::Vec<u8, N>,
    origin: u8,
    kind: Kind,
    write: impl FnOnce(&mut heapless::Vec<u8, N>) -> Result<(), EmitError>,
) -> Result<(), EmitError> {
    buffer.clear();
    let outcome = append(buffer, &[PREAMBLE, origin, 0, 0])
        .and_then(|()| write(buffer))
        .and_then(|()| complete(buffer, kind));
    if outcome.is_err() {
        buffer.clear();
    }
    outcome
}

/// Adds what belongs before and after the body.
fn complete<const N: usize>(buffer: &mut heapless::Vec<u8, N>, kind: Kind) -> Result<(), EmitError> {
    let body = buffer.get(HEADER..).unwrap_or_default();
    let mut sections = Sections::new(body);
    let last = sections.by_ref().last().ok_or(EmitError::Sections)?;
    if !sections.rest().is_empty() || is_trailer(&last) {
        return Err(EmitError::Sections);
    }
    let fill = match kind {
        Kind::Plain if body.len() < MIN_PACKET => (MIN_PACKET - body.len()).max(section::OVERHEAD),
        Kind::Plain => 0,
        _ => TRAILER,
    };
    let length = u16::try_from(body.len() + fill).map_err(|_| EmitError::TooLong)?;
    if usize::from(length) > MAX_PACKET || buffer.capacity() < usize::from(length) + OVERHEAD {
        return Err(EmitError::TooLong);
    }
    let header = (u16::from(kind.tag()) << TAG_SHIFT | length).to_be_bytes();
    buffer.iter_mut().skip(2).zip(header).for_each(|(place, byte)| *place = byte);
    match kind {
        Kind::Plain if fill > 0 => {
            let nothing = [0; MIN_PACKET];
            let nothing = nothing.get(..fill - section::OVERHEAD).unwrap_or_default();
            section::push(buffer, section::NOBODY, nothing)?;
        }
        Kind::Plain => {}
        _ => {
            append(buffer, &[section::TRAILER, TRAILER_DATA])?;
            append(buffer, &kind.detail())?;
            append(buffer, &kind.session().to_bytes())?;
            let crc = CRC.checksum(buffer.get(1..).unwrap_or_default());
            append(buffer, &crc.to_be_bytes())?;
            append(buffer, &[section::TERMINATOR])?;
        }
    }
    let check = lrc(buffer.get(HEADER..).unwrap_or_default());
    append(buffer, &[check, TERMINATOR])
}

/// Gives a whole frame another origin, and makes its checks anew.
///
/// # Errors
/// Any [`FrameError`] of what it was, which it still is then.
pub fn set_origin(frame: &mut [u8], origin: u8) -> Result<(), FrameError> {
    let tagged = parse(frame)?.kind != Kind::Plain;
    if let Some(place) = frame.get_mut(1) {
        *place = origin;
    }
    if tagged {
        let end = frame.len().saturating_sub(AFTER_COVERED);
        let crc = CRC.checksum(frame.get(1..end).unwrap_or_default());
        frame.iter_mut().skip(end).zip(crc.to_be_bytes()).for_each(|(place, byte)| *place = byte);
    }
    if let Some((packet, [check, _])) = frame.get_mut(HEADER..).and_then(<[u8]>::split_last_chunk_mut) {
        *check = lrc(packet);
    }
    Ok(())
}

fn append<const N: usize>(buffer: &mut heapless::Vec<u8, N>, bytes: &[u8]) -> Result<(), EmitError> {
    buffer.extend_from_slice(bytes).map_err(|_| EmitError::TooLong)
}
