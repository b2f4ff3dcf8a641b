//! Frames: their checks, their kinds, and the bytes of both. The crate's page has the layout.

use core::fmt;

use crate::Number;
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
pub(crate) const HEADER: usize = 4;
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

/// What a frame that carries something carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// What a station is; the newest counts.
    Status,
    /// What has happened.
    Event,
    /// What a station shall do or know.
    Data,
}

impl Class {
    const fn code(self) -> u8 {
        match self {
            Self::Status => 3,
            Self::Event => 4,
            Self::Data => 5,
        }
    }

    const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            3 => Self::Status,
            4 => Self::Event,
            5 => Self::Data,
            _ => return None,
        })
    }
}

/// Why a frame is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// It is of a session that the receiver does not know: one of the two has started anew.
    Session,
    /// It is longer than what the receiver can keep.
    TooLong,
    /// The receiver has no room for another peer.
    NoRoom,
    /// The receiver cannot make sense of its data.
    Meaningless,
}

impl Reason {
    const fn code(self) -> u8 {
        match self {
            Self::Session => 1,
            Self::TooLong => 2,
            Self::NoRoom => 3,
            Self::Meaningless => 4,
        }
    }

    const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            1 => Self::Session,
            2 => Self::TooLong,
            3 => Self::NoRoom,
            4 => Self::Meaningless,
            _ => return None,
        })
    }
}

/// Which run of a sender and which run of a receiver a frame belongs to; see [`crate::window`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Session {
    /// Drawn by the sender, never 0 in a session.
    pub sender: u16,
    /// Drawn by the receiver; 0 while it is asked for.
    pub receiver: u16,
}

impl Session {
    /// No session: a frame outside of any window.
    pub const NONE: Self = Self { sender: 0, receiver: 0 };

    const fn from_bytes([a, b, c, d]: [u8; 4]) -> Self {
        Self { sender: u16::from_be_bytes([a, b]), receiver: u16::from_be_bytes([c, d]) }
    }

    const fn to_bytes(self) -> [u8; 4] {
        let ([a, b], [c, d]) = (self.sender.to_be_bytes(), self.receiver.to_be_bytes());
        [a, b, c, d]
    }
}

/// What a frame is, with what its tag and its trailer say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// As in the thesis: untagged.
    Plain,
    /// One of a window.
    Numbered {
        /// Its place in the window.
        number: Number,
        /// What it carries.
        class: Class,
        /// The window's session.
        session: Session,
    },
    /// Outside of any window.
    Single(Class),
    /// What has arrived of a window.
    Acknowledgement {
        /// All before the number with these lower eight bits have arrived, and have been taken by whom they are for.
        next: u8,
        /// Bit i: the frame i after that has arrived.
        held: u8,
        /// The window's session.
        session: Session,
    },
    /// A frame of the thesis has arrived.
    Receipt {
        /// That frame's LRC.
        lrc: u8,
    },
    /// Negative acknowledgement.
    Refusal {
        /// Why.
        reason: Reason,
        /// Of the frame refused.
        session: Session,
    },
    /// A sender asks for a session.
    Opening {
        /// Its half of the session, never 0.
        sender: u16,
    },
    /// A receiver consents.
    Consent {
        /// Both halves.
        session: Session,
        /// Frames that the receiver can keep, 1 to 8.
        window: u8,
    },
}

impl Kind {
    const fn tag(self) -> u8 {
        match self {
            Self::Plain => 0,
            Self::Acknowledgement { .. } | Self::Receipt { .. } => 1,
            Self::Refusal { .. } => 2,
            Self::Single(class) => class.code(),
            Self::Opening { .. } => 6,
            Self::Consent { .. } => 7,
            Self::Numbered { number, .. } => WINDOW | number.split().0,
        }
    }

    const fn detail(self) -> [u8; 2] {
        match self {
            Self::Numbered { class, number, .. } => [class.code(), number.split().1],
            Self::Acknowledgement { next, held, .. } => [next, held],
            Self::Receipt { lrc } => [lrc, 0],
            Self::Refusal { reason, .. } => [reason.code(), 0],
            Self::Consent { window, .. } => [window, 0],
            Self::Plain | Self::Single(_) | Self::Opening { .. } => [0, 0],
        }
    }

    const fn session(self) -> Session {
        match self {
            Self::Numbered { session, .. }
            | Self::Acknowledgement { session, .. }
            | Self::Refusal { session, .. }
            | Self::Consent { session, .. } => session,
            Self::Opening { sender } => Session { sender, receiver: 0 },
            Self::Plain | Self::Single(_) | Self::Receipt { .. } => Session::NONE,
        }
    }

    /// The kind of a tagged frame.
    fn from_parts(tag: u8, detail: [u8; 2], session: Session) -> Option<Self> {
        let kind = match (tag, detail) {
            (1, [lrc, _]) if session == Session::NONE => Self::Receipt { lrc },
            (2, [reason, _]) => Self::Refusal { reason: Reason::from_code(reason)?, session },
            (3..=5, _) => Self::Single(Class::from_code(tag)?),
            _ if session.sender == 0 => return None,
            (1, [next, held]) => Self::Acknowledgement { next, held, session },
            (6, _) => Self::Opening { sender: session.sender },
            (7, [window @ 1..=8, _]) => Self::Consent { session, window },
            (WINDOW.., [class, upper]) => {
                Self::Numbered { number: Number::join(tag, upper), class: Class::from_code(class)?, session }
            }
            _ => return None,
        };
        // What a kind has no use for must be 0, so that a frame has one form.
        (kind.detail() == detail && kind.session() == session).then_some(kind)
    }
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

/// Why bytes are no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// Fewer or more bytes than its length says.
    Size,
    /// The first byte is not 7E.
    Preamble {
        /// The first byte.
        received: u8,
    },
    /// The tag is reserved.
    Tag {
        /// The tag.
        received: u8,
    },
    /// A packet of the tag cannot have this length.
    Length {
        /// The length.
        received: u16,
    },
    /// The last byte is not 0A.
    Terminator {
        /// The last byte.
        received: u8,
    },
    /// The LRC does not hold.
    Lrc {
        /// The LRC of what came.
        expected: u8,
        /// The LRC that came.
        received: u8,
    },
    /// The packet does not consist of sections.
    Sections,
    /// A tagged frame has no trailer, one of the thesis has, or what it says is reserved.
    Trailer,
    /// The CRC does not hold.
    Crc {
        /// The CRC of what came.
        expected: u32,
        /// The CRC that came.
        received: u32,
    },
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size => f.write_str("the frame is not as long as its length says"),
            Self::Preamble { received } => write!(f, "the frame begins with {received:02X}h instead of 7Eh"),
            Self::Tag { received } => write!(f, "tag {received} is reserved"),
            Self::Length { received } => write!(f, "the packet cannot be {received} bytes long"),
            Self::Terminator { received } => write!(f, "the frame ends with {received:02X}h instead of 0Ah"),
            Self::Lrc { expected, received } => {
                write!(f, "the LRC is {received:02X}h instead of {expected:02X}h")
            }
            Self::Sections => f.write_str("the packet does not consist of sections"),
            Self::Trailer => f.write_str("the trailer is missing, out of place or reserved"),
            Self::Crc { expected, received } => {
                write!(f, "the CRC is {received:08X}h instead of {expected:08X}h")
            }
        }
    }
}

impl core::error::Error for FrameError {}

/// Bytes of the frame that begins with `header`.
///
/// # Errors
/// `Preamble`, `Tag`, `Length`.
pub(crate) fn announced(header: [u8; HEADER]) -> Result<usize, FrameError> {
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

/// Why a frame cannot be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmitError {
    /// It does not fit its buffer, or its packet is longer than [`MAX_PACKET`].
    TooLong,
    /// Its body is not one or more sections, or ends with what would be taken for a trailer.
    Sections,
}

impl fmt::Display for EmitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the frame is too long",
            Self::Sections => "the body does not consist of sections",
        })
    }
}

impl core::error::Error for EmitError {}

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
    buffer.clear();
    let outcome = write(buffer, origin, kind, body);
    if outcome.is_err() {
        buffer.clear();
    }
    outcome
}

fn write<const N: usize>(
    buffer: &mut heapless::Vec<u8, N>,
    origin: u8,
    kind: Kind,
    body: &[u8],
) -> Result<(), EmitError> {
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
    let [high, low] = (u16::from(kind.tag()) << TAG_SHIFT | length).to_be_bytes();
    append(buffer, &[PREAMBLE, origin, high, low])?;
    append(buffer, body)?;
    match kind {
        Kind::Plain if fill > 0 => {
            let nothing = [0; MIN_PACKET];
            let nothing = nothing.get(..fill - section::OVERHEAD).unwrap_or_default();
            section::push(buffer, section::NOBODY, nothing).map_err(|_| EmitError::TooLong)?;
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

fn append<const N: usize>(buffer: &mut heapless::Vec<u8, N>, bytes: &[u8]) -> Result<(), EmitError> {
    buffer.extend_from_slice(bytes).map_err(|_| EmitError::TooLong)
}
