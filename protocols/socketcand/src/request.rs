//! What a client says.

use core::fmt::Write;

use puente_canopen::{Frame, Id};

use crate::MAX_BUS;
use crate::texts::Text;
use crate::words::{self, decimal, words};

/// A request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request<'a> {
    /// `open BUS`: answered by `ok`, or an error.
    Open(&'a str),
    /// `rawmode`: every frame of the bus from now on. Answered by `ok`.
    RawMode,
    /// `bcmmode`: only what is subscribed to. It is the mode after `open`. Answered by `ok`.
    BcmMode,
    /// `send ID LENGTH BYTE*`: sends a frame, in either mode. Not answered.
    Send(Frame),
    /// `subscribe SECONDS MICROS ID`: frames of this identifier, in BCM mode; no more than one in so much time.
    Subscribe {
        /// Which.
        id: Id,
        /// Microseconds between two of them at least; 0: all.
        micros: u64,
    },
    /// `unsubscribe ID`.
    Unsubscribe(Id),
    /// `echo`: answered by the same.
    Echo,
    /// `statistics MILLISECONDS`: tells them so often; 0: not any more.
    Statistics(u32),
    /// A request of socketcand that is not supported, and answered by an error: `controlmode`, `isotpmode` and what belongs to
    /// it, `add`, `update` and `delete` (frames sent again and again), `filter` and `muxfilter` (frames whose contents change),
    /// and those that set up a bus.
    Unsupported,
}

/// A text that is no request. The answer is `error unknown command`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BadRequest;

/// Requests that are only named.
const UNSUPPORTED: [&[u8]; 9] = [
    b"controlmode",
    b"isotpmode",
    b"isotpconf",
    b"sendpdu",
    b"add",
    b"update",
    b"delete",
    b"filter",
    b"muxfilter",
];

impl<'a> Request<'a> {
    /// Reads a text without its brackets.
    pub fn parse(text: &'a [u8]) -> Result<Self, BadRequest> {
        Self::read(text).ok_or(BadRequest)
    }

    fn read(text: &'a [u8]) -> Option<Self> {
        let mut words = words(text);
        let verb = words.next()?;
        let request = match verb {
            b"open" => {
                let bus = words.next()?;
                let valid = bus.len() <= MAX_BUS && bus.iter().all(u8::is_ascii_graphic);
                Self::Open(valid.then(|| core::str::from_utf8(bus).ok())??)
            }
            b"rawmode" => Self::RawMode,
            b"bcmmode" => Self::BcmMode,
            b"send" => return words::frame(words).map(Self::Send),
            b"subscribe" => {
                let seconds = decimal(words.next()?)?;
                let micros = decimal(words.next()?)?;
                let micros = u64::from(seconds) * 1_000_000 + u64::from(micros);
                Self::Subscribe { id: words::id(words.next()?)?, micros }
            }
            b"unsubscribe" => Self::Unsubscribe(words::id(words.next()?)?),
            b"echo" => Self::Echo,
            b"statistics" => Self::Statistics(decimal(words.next()?)?),
            verb if UNSUPPORTED.contains(&verb) => return Some(Self::Unsupported),
            _ => return None,
        };
        words.next().is_none().then_some(request)
    }

    /// The text, with its brackets; `None` for a remote frame, which the protocol does not have, for a bus without a name that
    /// it can have, and for [`Request::Unsupported`].
    pub fn emit(&self) -> Option<Text> {
        let mut text = Text::new();
        match *self {
            Self::Open(bus) => {
                let valid = (1..=MAX_BUS).contains(&bus.len())
                    && bus.bytes().all(|byte| byte.is_ascii_graphic() && !matches!(byte, b'<' | b'>'));
                valid.then_some(())?;
                write!(text, "< open {bus} >")
            }
            Self::RawMode => write!(text, "< rawmode >"),
            Self::BcmMode => write!(text, "< bcmmode >"),
            Self::Send(frame) if frame.is_remote() => return None,
            Self::Send(frame) => {
                write!(text, "< send {} {} ", Name(frame.id()), frame.length()).ok()?;
                for byte in frame.data() {
                    write!(text, "{byte:02x} ").ok()?;
                }
                write!(text, ">")
            }
            Self::Subscribe { id, micros } => {
                write!(text, "< subscribe {} {} {} >", micros / 1_000_000, micros % 1_000_000, Name(id))
            }
            Self::Unsubscribe(id) => write!(text, "< unsubscribe {} >", Name(id)),
            Self::Echo => write!(text, "< echo >"),
            Self::Statistics(millis) => write!(text, "< statistics {millis} >"),
            Self::Unsupported => return None,
        }
        .ok()?;
        Some(text)
    }
}

/// An identifier as texts have it: three digits, or eight of an extended one.
pub(crate) struct Name(pub Id);

impl core::fmt::Display for Name {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.0 {
            Id::Base(id) => write!(f, "{id:03X}"),
            Id::Extended(id) => write!(f, "{id:08X}"),
        }
    }
}
