//! What a frame is: what its tag and its trailer say.

use super::WINDOW;
use crate::Number;

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
    /// Of a gateway: every attempt to send it collided, or something holds the line.
    Collisions,
    /// Of a gateway: it does not hear itself on the line, so it keeps quiet.
    NoEcho,
    /// Of a gateway: it has no line to send it on.
    NoLine,
    /// Of a gateway: another commands what it would move, or its sender may not.
    Denied,
    /// Of a gateway: a stop came first.
    Stopped,
    /// Of a gateway, to nothing that was sent: frames were heard and have been lost before they were taken.
    Lost,
}

impl Reason {
    /// In the order of their codes, from 1 on.
    const ALL: [Self; 10] = [
        Self::Session,
        Self::TooLong,
        Self::NoRoom,
        Self::Meaningless,
        Self::Collisions,
        Self::NoEcho,
        Self::NoLine,
        Self::Denied,
        Self::Stopped,
        Self::Lost,
    ];

    const fn code(self) -> u8 {
        self as u8 + 1
    }

    fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code).checked_sub(1)?).copied()
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

    pub(super) const fn from_bytes([a, b, c, d]: [u8; 4]) -> Self {
        Self { sender: u16::from_be_bytes([a, b]), receiver: u16::from_be_bytes([c, d]) }
    }

    pub(super) const fn to_bytes(self) -> [u8; 4] {
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
    pub(super) const fn tag(self) -> u8 {
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

    pub(super) const fn detail(self) -> [u8; 2] {
        match self {
            Self::Numbered { class, number, .. } => [class.code(), number.split().1],
            Self::Acknowledgement { next, held, .. } => [next, held],
            Self::Receipt { lrc } => [lrc, 0],
            Self::Refusal { reason, .. } => [reason.code(), 0],
            Self::Consent { window, .. } => [window, 0],
            Self::Plain | Self::Single(_) | Self::Opening { .. } => [0, 0],
        }
    }

    pub(super) const fn session(self) -> Session {
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
    pub(super) fn from_parts(tag: u8, detail: [u8; 2], session: Session) -> Option<Self> {
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
