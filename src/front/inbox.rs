//! What a client has sent and nobody has used yet.

use embedded_io_async::Read;

use super::End;
use crate::clock;
use crate::desk::Desk;

/// A Modbus ASCII frame has 513 bytes; the head of an HTTP request is as long as the browser likes.
const CAPACITY: usize = crate::port::limits::INBOX;

/// A buffered reader. Every byte that arrives renews the leases of its client.
pub(super) struct Inbox<'g, R> {
    reader: R,
    desk: &'g Desk,
    connection: u32,
    buffer: [u8; CAPACITY],
    start: usize,
    end: usize,
    ended: bool,
}

impl<'g, R: Read> Inbox<'g, R> {
    pub(super) fn new(reader: R, desk: &'g Desk, connection: u32) -> Self {
        Self { reader, desk, connection, buffer: [0; CAPACITY], start: 0, end: 0, ended: false }
    }

    /// What has arrived.
    pub(super) fn data(&self) -> &[u8] {
        self.buffer.get(self.start..self.end).unwrap_or_default()
    }

    /// The client has closed its side; [`data`](Self::data) is all there will be.
    pub(super) fn ended(&self) -> bool {
        self.ended
    }

    /// No more fits.
    pub(super) fn full(&self) -> bool {
        self.end - self.start == CAPACITY
    }

    /// Drops the first `count` bytes.
    pub(super) fn consume(&mut self, count: usize) {
        self.start = (self.start + count).min(self.end);
    }

    /// Waits for more. At the end of the stream it marks that and takes the client's leases back; a full inbox, or one
    /// that has ended, waits for ever. Loses nothing when dropped.
    pub(super) async fn fill(&mut self) -> Result<(), End> {
        if self.full() || self.ended {
            return core::future::pending().await;
        }
        if self.start > 0 {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
        }
        let room = self.buffer.get_mut(self.end..).unwrap_or_default();
        match self.reader.read(room).await {
            Ok(0) => {
                self.ended = true;
                self.desk.leave(clock::now(), self.connection);
            }
            Ok(count) => {
                self.end += count;
                self.desk.renew(clock::now(), self.connection);
            }
            Err(_) => return Err(End::Broken),
        }
        Ok(())
    }
}
