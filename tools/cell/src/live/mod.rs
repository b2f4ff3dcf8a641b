//! A cell in real time: its line on pseudo terminals, TCP ports and serial devices.

pub mod can;
mod port;
mod ports;
mod terminal;

use std::io::{self, ErrorKind};
use std::os::fd::BorrowedFd;
use std::time::Duration;

pub use port::{Place, Port};
pub use ports::Ports;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

/// What has come through a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// Nothing.
    Nothing,
    /// Bytes, or a client has come or gone; there may be more.
    Bytes,
    /// The far side has dropped what it had written before, of a pseudo terminal (`tcflush`). There may be more, and of what
    /// was dropped the system may have passed on a rest.
    Discard,
}

/// Waits until one of them can be read, for at most `most`, for ever without it.
pub fn wait<'a>(fds: impl IntoIterator<Item = BorrowedFd<'a>>, most: Option<Duration>) -> io::Result<()> {
    let fds: Vec<_> = fds.into_iter().collect();
    let mut fds: Vec<_> = fds.iter().map(|fd| PollFd::new(fd, PollFlags::IN)).collect();
    let most = most.and_then(|most| Timespec::try_from(most).ok());
    match poll(&mut fds, most.as_ref()) {
        Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// Timers of this thread become exact: Linux may otherwise be 50 µs late with each character.
pub fn exact_timers() {
    #[cfg(target_os = "linux")]
    let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
}

/// The bytes that were read from something that must not end; 0 where there is nothing yet.
fn received(count: io::Result<usize>, what: &str) -> io::Result<usize> {
    match count {
        Ok(0) => Err(io::Error::other(format!("the {what} is gone"))),
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
        count => count,
    }
}
