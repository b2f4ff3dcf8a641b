//! What a client is answered.

use core::fmt;

use puente_canopen::lss::Identity;
use puente_canopen::sdo::Abort;

use crate::Error;

/// The reply to a command: a line, with its end. What was read follows `[12] ` itself, see [`Reply::head`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// The number of the command.
    pub sequence: u32,
    /// What is answered.
    pub answer: Answer,
}

/// What is answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// `OK`.
    Ok,
    /// `ERROR:101 #Syntax error.`
    Error(Error),
    /// `ERROR:0x06020000 #Object does not exist.`
    Abort(Abort),
    /// Part of an identity: `0x0000000A`.
    Part(u32),
    /// A node-ID: `0xFF`.
    NodeId(u8),
    /// An identity: its four parts.
    Identity(Identity),
}

impl Reply {
    /// What stands before a value that was read.
    pub fn head(sequence: u32) -> impl fmt::Display {
        fmt::from_fn(move |f| write!(f, "[{sequence}] "))
    }

    /// The end of a value of which part has been sent when its transfer failed.
    pub fn broken_off(abort: Abort) -> impl fmt::Display {
        fmt::from_fn(move |f| write!(f, "\n...{}\r\n", Answer::Abort(abort)))
    }
}

impl fmt::Display for Reply {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}\r\n", Self::head(self.sequence), self.answer)
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ok => f.write_str("OK"),
            Self::Error(error) => write!(f, "ERROR:{} #{}", error.code(), error.text()),
            Self::Abort(abort) => {
                write!(f, "ERROR:0x{:08X} #", abort.0)?;
                // A sentence of the words that the table has.
                let mut text = abort.text().unwrap_or_default().chars();
                match text.next() {
                    Some(first) => write!(f, "{}{}.", first.to_ascii_uppercase(), text.as_str()),
                    None => f.write_str("-"),
                }
            }
            Self::Part(part) => write!(f, "0x{part:08X}"),
            Self::NodeId(id) => write!(f, "0x{id:02X}"),
            Self::Identity(who) => write!(
                f,
                "0x{:08X} 0x{:08X} 0x{:08X} 0x{:08X}",
                who.vendor, who.product, who.revision, who.serial
            ),
        }
    }
}
