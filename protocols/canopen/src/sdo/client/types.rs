//! What goes into a client and comes out of it.

use core::fmt;
use core::time::Duration;

use heapless::Vec;

use super::super::{Abort, MAX_BLOCK, SEGMENT};
use crate::{Address, Frame};

/// How a client works its channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// For each response, and in a block upload for each segment.
    pub timeout: Duration,
    /// After a response that did not come nothing is asked for so long, unless it comes late: it could be taken for the
    /// response to what is asked next.
    pub quarantine: Duration,
    /// So many time-outs in a row a block transfer survives, and so many blocks of which nothing arrived; so often a plain
    /// read is asked again.
    pub retries: u8,
    /// Segments of a block that is read, 1 to 127; of one that is written the server decides.
    pub block: u8,
    /// A block upload of at most so many bytes may come as a plain one; 0: it may not (7.2.4.3.13, pst).
    pub threshold: u8,
}

impl Config {
    /// 500 ms for a response and of quarantine, 3 retries, blocks of 127 segments, no change of protocol.
    pub const DEFAULT: Self = Self {
        timeout: Duration::from_millis(500),
        quarantine: Duration::from_millis(500),
        retries: 3,
        block: MAX_BLOCK,
        threshold: 0,
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// What a client is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// Reads.
    Upload {
        /// What.
        address: Address,
        /// In blocks.
        block: bool,
    },
    /// Writes.
    Download {
        /// What.
        address: Address,
        /// How many bytes. 1 to 4 are written at once, others in segments.
        size: u32,
        /// In blocks, whatever the size.
        block: bool,
    },
}

impl Transfer {
    /// The object.
    pub const fn address(&self) -> Address {
        match self {
            Self::Upload { address, .. } | Self::Download { address, .. } => *address,
        }
    }
}

/// The outcome of the last transfer has not been fetched yet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Busy;

impl fmt::Display for Busy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the SDO channel has a transfer in work")
    }
}

impl core::error::Error for Busy {}

/// What the caller has to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Action {
    /// Send this frame.
    Transmit(Frame),
    /// Call [`Client::supply`](super::Client::supply) with these bytes of what is written. They may be asked for again.
    Fetch {
        /// Of the first of them.
        offset: u32,
        /// How many, 1 to 7.
        count: usize,
    },
    /// The next bytes of what is read. They are the object's only when the transfer ends well.
    Data(Vec<u8, SEGMENT>),
    /// The transfer is over.
    Done(Result<Outcome, Failure>),
    /// Nothing until the next frame or the time of [`Client::poll_at`](super::Client::poll_at).
    Idle,
}

/// How a transfer ended well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Read; the bytes have been given.
    Read {
        /// How many they were.
        size: u32,
        /// Whether they were as many as the server had said, or a CRC held over them.
        checked: bool,
    },
    /// Written, and confirmed.
    Written,
}

/// How a transfer ended otherwise. What was to be written may have been written, unless it is `Aborted` or `NotSent`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The server aborted it.
    Aborted(Abort),
    /// No response in time.
    Timeout {
        /// First byte of the last message of the server that was none to this transfer.
        heard: Option<u8>,
    },
    /// The toggle bit of a response did not alternate.
    Toggle,
    /// The server asks for blocks of no or more than 127 segments.
    BlockSize {
        /// So many.
        received: u8,
    },
    /// The server acknowledges more segments than were sent.
    Sequence {
        /// Sent.
        sent: u8,
        /// Acknowledged.
        received: u8,
    },
    /// An acknowledgement was lost, and nothing in the protocol tells where the server is.
    Position,
    /// Nothing of a block arrived, again and again.
    Stuck,
    /// The CRC does not hold.
    Crc {
        /// The CRC computed over what came.
        expected: u16,
        /// The CRC that came.
        received: u16,
    },
    /// Not as many bytes as the server had said.
    Size {
        /// It said.
        expected: u32,
        /// That came.
        received: u32,
    },
    /// The caller did not supply the bytes that were to be written.
    Supply,
    /// The node has booted meanwhile, and knows nothing of it any more.
    Booted,
    /// The bus is off.
    BusOff,
    /// The caller gave it up.
    Cancelled,
    /// The caller gave it up before anything was sent.
    NotSent,
}

impl Failure {
    /// The abort code of it: the server's, or what the server is told.
    pub const fn code(self) -> Abort {
        match self {
            Self::Aborted(code) => code,
            Self::Timeout { .. } => Abort::TIMEOUT,
            Self::Toggle => Abort::TOGGLE,
            Self::BlockSize { .. } => Abort::BLOCK_SIZE,
            Self::Sequence { .. } | Self::Position | Self::Stuck => Abort::SEQUENCE,
            Self::Crc { .. } => Abort::CRC,
            Self::Size { .. } => Abort::LENGTH,
            Self::Booted | Self::BusOff => Abort::TRANSFER,
            Self::Supply | Self::Cancelled | Self::NotSent => Abort::LOCAL_CONTROL,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Aborted(code) => write!(f, "the node refused: {code}"),
            Self::Timeout { heard: None } => f.write_str("the node did not answer"),
            Self::Timeout { heard: Some(byte) } => {
                write!(f, "the node did not answer this; it said {byte:02X}h last")
            }
            Self::Toggle => f.write_str("the toggle bit did not alternate"),
            Self::BlockSize { received } => write!(f, "the node asks for blocks of {received} segments"),
            Self::Sequence { sent, received } => {
                write!(f, "the node acknowledged {received} segments of {sent}")
            }
            Self::Position => f.write_str("an acknowledgement of the node was lost"),
            Self::Stuck => f.write_str("no segment arrives"),
            Self::Crc { expected, received } => {
                write!(f, "the CRC is {received:04X}h instead of {expected:04X}h")
            }
            Self::Size { expected, received } => {
                write!(f, "{received} bytes came instead of {expected}")
            }
            Self::Supply => f.write_str("the data to write ended early"),
            Self::Booted => f.write_str("the node booted meanwhile"),
            Self::BusOff => f.write_str("the bus is off"),
            Self::Cancelled => f.write_str("given up"),
            Self::NotSent => f.write_str("given up before it was sent"),
        }
    }
}

impl core::error::Error for Failure {}

/// Events since start-up, each modulo 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Transfers begun.
    pub transfers: u32,
    /// Transfers that ended well.
    pub completed: u32,
    /// Transfers that the server aborted.
    pub aborted: u32,
    /// Transfers that ended because no response came.
    pub timeouts: u32,
    /// Segments sent again, and those that came out of order.
    pub repeated: u32,
    /// Messages of the server that came when none was due.
    pub late: u32,
    /// Messages of the server that were not those due, or malformed.
    pub unpaired: u32,
}

impl core::ops::AddAssign for Counters {
    fn add_assign(&mut self, other: Self) {
        let Self { transfers, completed, aborted, timeouts, repeated, late, unpaired } = other;
        for (sum, count) in [
            (&mut self.transfers, transfers),
            (&mut self.completed, completed),
            (&mut self.aborted, aborted),
            (&mut self.timeouts, timeouts),
            (&mut self.repeated, repeated),
            (&mut self.late, late),
            (&mut self.unpaired, unpaired),
        ] {
            *sum = sum.wrapping_add(count);
        }
    }
}
