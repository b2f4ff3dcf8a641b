//! What comes in.

use core::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};
use core::task::Waker;

use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::ErrorKind;

use super::registers::Arrival;

/// Why received characters are not to be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Characters came faster than they were fetched, and some are lost.
    Overrun,
    /// No stop bit where one was due: noise, a collision, or another baud rate or format.
    Framing,
    /// The parity bit does not match.
    Parity,
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Error::Overrun => "characters were lost",
            Error::Framing => "a character had no stop bit",
            Error::Parity => "a character had the wrong parity",
        })
    }
}

impl core::error::Error for Error {}

impl embedded_io_async::Error for Error {
    fn kind(&self) -> ErrorKind {
        ErrorKind::InvalidData
    }
}

/// What embassy's driver does not do with received characters, so that handlers of our own do it before and after its
/// own: it drops errors and passes the spoilt character on as a good one, and it wakes the reader at each character, or
/// at a pause only.
pub(super) struct Receiver {
    /// Errors, kept until somebody reads.
    errors: AtomicU8,
    /// Characters that the reader still waits for.
    expected: AtomicUsize,
    /// The last of them is there, or one that nobody waits for.
    due: AtomicBool,
    reader: AtomicWaker,
}

impl Receiver {
    const OVERRUN: u8 = 1;
    const FRAMING: u8 = 2;
    const PARITY: u8 = 4;

    pub(super) const fn new() -> Self {
        Self {
            errors: AtomicU8::new(0),
            expected: AtomicUsize::new(1),
            due: AtomicBool::new(false),
            reader: AtomicWaker::new(),
        }
    }

    /// Before the character is fetched.
    pub(super) fn arriving(&self, arrival: Arrival) {
        let flag = |set, bit| if set { bit } else { 0 };
        let seen = flag(arrival.overrun, Self::OVERRUN)
            | flag(arrival.framing, Self::FRAMING)
            | flag(arrival.parity, Self::PARITY);
        if seen != 0 {
            self.errors.fetch_or(seen, Ordering::Relaxed);
        }
        if arrival.received {
            // Nobody else writes at this priority, and nothing interrupts it.
            let expected = self.expected.load(Ordering::Relaxed).saturating_sub(1);
            self.expected.store(expected, Ordering::Relaxed);
            self.due.store(expected == 0, Ordering::Relaxed);
        }
    }

    /// After it was fetched.
    pub(super) fn arrived(&self) {
        if self.due.load(Ordering::Relaxed) {
            self.due.store(false, Ordering::Relaxed);
            self.reader.wake();
        }
    }

    /// Who is to be woken.
    pub(super) fn register(&self, reader: &Waker) {
        self.reader.register(reader);
    }

    /// Wakes the reader at the last of so many characters, or at a pause.
    pub(super) fn expect(&self, count: usize) {
        self.expected.store(count, Ordering::Relaxed);
    }

    /// The worst error since the last call.
    pub(super) fn take_error(&self) -> Option<Error> {
        match self.errors.swap(0, Ordering::Relaxed) {
            0 => None,
            seen if seen & Self::OVERRUN != 0 => Some(Error::Overrun),
            seen if seen & Self::FRAMING != 0 => Some(Error::Framing),
            _ => Some(Error::Parity),
        }
    }
}
