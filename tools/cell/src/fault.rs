//! Faults of a drive's answers.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

use puente_modbus::{Mode, Pdu, ascii, rtu};

/// What goes wrong with the requests to one drive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Fault {
    /// Nothing.
    #[default]
    None,
    /// The drive hears nothing: it neither executes nor answers, broadcasts included.
    Silent,
    /// The drive executes, its reply is lost.
    Lost,
    /// The reply comes that much later than usual.
    Late(Duration),
    /// One character of the reply arrives changed; the check does not match.
    Corrupt,
    /// The reply carries another address, with a right check.
    WrongUnit,
    /// The reply carries another function code, with a right check.
    WrongFunction,
    /// The reply to a read announces two bytes more than follow; any other reply is one byte too long. The check is
    /// right.
    WrongByteCount,
    /// The reply to a read is that of one word more than asked, consistent in itself; other replies are unchanged.
    OtherQuantity,
    /// The second half of the reply is missing.
    Truncated,
    /// The request comes back before the reply.
    Echo,
    /// One to eight random bytes come right before the reply.
    GarbageBefore,
    /// One to eight random bytes come right after the reply.
    GarbageAfter,
    /// The reply comes twice, the second time after a silence.
    Duplicate,
    /// The drive does not execute and answers this exception code.
    Exception(u8),
    /// The fault for the next `count` requests, then another one.
    Times {
        /// Requests left.
        count: u32,
        /// What goes wrong with them.
        fault: Box<Fault>,
        /// What goes wrong afterwards.
        then: Box<Fault>,
    },
}

impl Fault {
    /// This fault for the next `count` requests only.
    pub fn times(self, count: u32) -> Self {
        self.times_then(count, Self::None)
    }

    /// This fault for the next `count` requests, then `then`.
    pub fn times_then(self, count: u32, then: Self) -> Self {
        Self::Times { count, fault: Box::new(self), then: Box::new(then) }
    }

    /// What goes wrong with the next request, without counting it.
    pub(crate) fn peek(&self) -> &Self {
        match self {
            Self::Times { count: 0, then, .. } => then.peek(),
            Self::Times { fault, .. } => fault.peek(),
            plain => plain,
        }
    }

    /// What goes wrong with this request, which is counted.
    pub(crate) fn take(&mut self) -> Self {
        while let Self::Times { count: 0, then, .. } = self {
            *self = std::mem::take(then);
        }
        match self {
            Self::Times { count, fault, .. } => {
                *count -= 1;
                fault.take()
            }
            plain => plain.clone(),
        }
    }
}

/// A text that is no fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadFault(String);

impl fmt::Display for BadFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "'{}' is no fault; there are none, silent, lost, late:MILLISECONDS, corrupt, wrong-unit, ",
            self.0
        )?;
        f.write_str("wrong-function, wrong-byte-count, other-quantity, truncated, echo, garbage-before, ")?;
        f.write_str(
            "garbage-after, duplicate and exception:CODE, and *COUNT behind one for that many requests",
        )
    }
}

impl std::error::Error for BadFault {}

impl FromStr for Fault {
    type Err = BadFault;

    /// Reads `silent`, `late:300` (milliseconds), `exception:6`, and `corrupt*3` for three requests only.
    fn from_str(text: &str) -> Result<Self, BadFault> {
        let bad = || BadFault(text.to_string());
        if let Some((fault, count)) = text.split_once('*') {
            return Ok(fault.parse::<Self>().map_err(|_| bad())?.times(count.parse().map_err(|_| bad())?));
        }
        Ok(match text.split_once(':') {
            Some(("late", ms)) => Self::Late(Duration::from_millis(ms.parse().map_err(|_| bad())?)),
            Some(("exception", code)) => Self::Exception(code.parse().map_err(|_| bad())?),
            Some(_) => return Err(bad()),
            None => match text {
                "none" => Self::None,
                "silent" => Self::Silent,
                "lost" => Self::Lost,
                "corrupt" => Self::Corrupt,
                "wrong-unit" => Self::WrongUnit,
                "wrong-function" => Self::WrongFunction,
                "wrong-byte-count" => Self::WrongByteCount,
                "other-quantity" => Self::OtherQuantity,
                "truncated" => Self::Truncated,
                "echo" => Self::Echo,
                "garbage-before" => Self::GarbageBefore,
                "garbage-after" => Self::GarbageAfter,
                "duplicate" => Self::Duplicate,
                _ => return Err(bad()),
            },
        })
    }
}

/// Bytes that a drive puts on the line.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Transmission {
    /// Time beyond the usual reply delay.
    pub extra: Duration,
    pub bytes: Vec<u8>,
}

/// The frame around a PDU.
pub(crate) fn frame(mode: Mode, unit: u8, pdu: &Pdu) -> Vec<u8> {
    match mode {
        Mode::Rtu => rtu::emit(unit, pdu).to_vec(),
        Mode::Ascii => ascii::emit(unit, pdu).to_vec(),
    }
}

/// What the line sees of a reply under a fault.
///
/// `silence` separates two frames. Faults that keep the drive from executing are the caller's.
pub(crate) fn transmissions(
    fault: &Fault,
    mode: Mode,
    unit: u8,
    request: &Pdu,
    reply: &Pdu,
    silence: Duration,
    random: &mut Random,
) -> Vec<Transmission> {
    let one = |bytes| vec![Transmission { extra: Duration::ZERO, bytes }];
    let good = frame(mode, unit, reply);
    match fault {
        Fault::None | Fault::Exception(_) | Fault::Times { .. } => one(good),
        Fault::Silent | Fault::Lost => Vec::new(),
        Fault::Late(extra) => vec![Transmission { extra: *extra, bytes: good }],
        Fault::Corrupt => one(corrupt(mode, good, random)),
        Fault::WrongUnit => one(frame(mode, unit % 247 + 1, reply)),
        Fault::WrongFunction => one(frame(mode, unit, &wrong_function(reply))),
        Fault::WrongByteCount => one(frame(mode, unit, &wrong_byte_count(reply))),
        Fault::OtherQuantity => one(frame(mode, unit, &other_quantity(reply))),
        Fault::Truncated => one(good[..good.len() / 2].to_vec()),
        Fault::Echo => one([frame(mode, unit, request), good].concat()),
        Fault::GarbageBefore => one([random.garbage(), good].concat()),
        Fault::GarbageAfter => one([good, random.garbage()].concat()),
        Fault::Duplicate => vec![
            Transmission { extra: Duration::ZERO, bytes: good.clone() },
            Transmission { extra: silence, bytes: good },
        ],
    }
}

/// One changed character, which LRC and CRC always find.
fn corrupt(mode: Mode, mut frame: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let inside = match mode {
        Mode::Rtu => 0..frame.len(),
        Mode::Ascii => 1..frame.len().saturating_sub(2),
    };
    let at = inside.start + random.below(inside.len());
    if let Some(byte) = frame.get_mut(at) {
        *byte = match (mode, *byte) {
            (Mode::Rtu, byte) => byte ^ 1 << random.below(8),
            (Mode::Ascii, b'9') => b'A',
            (Mode::Ascii, b'F') => b'0',
            (Mode::Ascii, digit) => digit + 1,
        };
    }
    frame
}

/// Another function that is answered alike: 03 for 04 and 04 for all others.
fn wrong_function(reply: &Pdu) -> Pdu {
    let mut reply = reply.clone();
    if let Some(function) = reply.first_mut() {
        *function = if *function == 0x04 { 0x03 } else { 0x04 };
    }
    reply
}

fn wrong_byte_count(reply: &Pdu) -> Pdu {
    let mut reply = reply.clone();
    match reply.as_mut_slice() {
        [0x03, count, ..] => *count = count.wrapping_add(2),
        _ => reply.push(0).unwrap_or_default(),
    }
    reply
}

fn other_quantity(reply: &Pdu) -> Pdu {
    let mut longer = reply.clone();
    match (longer.as_mut_slice(), reply.len() + 2 <= reply.capacity()) {
        ([0x03, count, ..], true) => *count += 2,
        _ => return longer,
    }
    longer.extend_from_slice(&[0, 0]).unwrap_or_default();
    longer
}

/// SplitMix64: reproducible random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Random(pub u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ mixed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    /// 0 to `end` - 1, and 0 for an empty range.
    fn below(&mut self, end: usize) -> usize {
        (self.next() % (end as u64).max(1)) as usize
    }

    fn garbage(&mut self) -> Vec<u8> {
        (0..=self.below(8)).map(|_| self.next() as u8).collect()
    }
}
