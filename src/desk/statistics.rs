//! What is counted on each bus.

use puente_line::Duration;
use puente_modbus::Counters;

use super::Reason;

/// Upper bounds of the latency histogram, in ms; one more bucket takes the rest.
pub const BUCKETS_MS: [u32; 9] = [5, 10, 20, 50, 100, 200, 500, 1000, 2000];

/// Counts since start-up.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// Requests that clients handed in.
    pub submitted: u32,
    /// Requests with a reply, exceptions included.
    pub confirmed: u32,
    /// Replies that were exceptions.
    pub exceptions: u32,
    /// Broadcasts sent.
    pub broadcasts: u32,
    /// Requests sent without a usable reply.
    pub no_reply: u32,
    /// Requests not sent: they waited too long.
    pub expired: u32,
    /// Requests not sent: the slave was resting.
    pub rested: u32,
    /// Requests not sent: a stop came first.
    pub stopped: u32,
    /// Requests not sent: the port was down.
    pub line_down: u32,
    /// Requests refused: the queue was full.
    pub queue_full: u32,
    /// Requests waiting now.
    pub waiting: usize,
    /// Slaves out of order now.
    pub resting: usize,
    /// Sum of the latencies of all confirmed requests, from queueing to reply, in µs.
    pub latency_sum_us: u64,
    /// Confirmed requests by latency, see [`BUCKETS_MS`].
    pub latency: [u32; BUCKETS_MS.len() + 1],
    /// What the master counted on the line.
    pub line: Counters,
}

/// The buses at a glance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Traffic {
    /// Requests that were on a line, modulo 2^32.
    pub transactions: u32,
    /// A slave is out of order.
    pub resting: bool,
}

impl Statistics {
    /// Requests that were on the line, modulo 2^32.
    pub(super) fn on_line(&self) -> u32 {
        self.confirmed.wrapping_add(self.broadcasts).wrapping_add(self.no_reply)
    }

    pub(super) fn answered(&mut self, latency: Duration, reply: &[u8]) {
        self.confirmed += 1;
        if reply.first().is_some_and(|function| function & 0x80 != 0) {
            self.exceptions += 1;
        }
        self.latency_sum_us += puente_line::micros(latency);
        let bucket = BUCKETS_MS.iter().position(|ms| latency <= Duration::from_millis(u64::from(*ms)));
        if let Some(count) = self.latency.get_mut(bucket.unwrap_or(BUCKETS_MS.len())) {
            *count += 1;
        }
    }

    pub(super) fn not_sent(&mut self, reason: Reason) {
        match reason {
            Reason::Expired => self.expired += 1,
            Reason::Resting(_) => self.rested += 1,
            Reason::Stopped => self.stopped += 1,
            Reason::LineDown => self.line_down += 1,
            Reason::QueueFull => self.queue_full += 1,
            // The counts of a cyclic bus are its master's.
            Reason::Unmapped | Reason::Line(_) => {}
        }
    }
}
