//! The sending of a reply: whole with its length where it fits the buffer, else in chunks (RFC 9112, section 7.1).
//!
//! There is one buffer a client, so it is small; what is formatted is not kept while the network takes it.

use core::fmt::{self, Write as _};
use core::ops::Range;

use embassy_time::with_timeout;
use embedded_io_async::Write;
use serde::Serialize;

use super::super::{End, SLOW_READER};
use super::page::{Asset, POLICY};
use super::problem::Problem;
use super::status::{self, Status};

/// Room before the body, for the head and the length of a chunk.
const FRONT: usize = 256;
/// Room for the body. The longest piece of a reply must fit: an axis.
pub(super) const BODY: usize = 1024;
/// Room after the body, for what ends a chunk and the last one.
const BACK: usize = 7;

const JSON: &str = "application/json";

/// How the client wants its reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Manner {
    /// In chunks, where it is long; else it ends with the connection.
    pub chunks: bool,
    /// With its body; the head alone otherwise.
    pub body: bool,
    /// The connection stays open.
    pub keep_alive: bool,
}

/// A reply on its way.
pub(super) struct Reply<'w, W> {
    writer: &'w mut W,
    pub manner: Manner,
    content_type: &'static str,
    buffer: [u8; FRONT + BODY + BACK],
    /// Bytes of the body in the buffer.
    filled: usize,
    /// The head is sent, and pieces follow.
    begun: bool,
}

impl<'w, W: Write> Reply<'w, W> {
    pub(super) fn new(writer: &'w mut W, manner: Manner) -> Self {
        let buffer = [0; FRONT + BODY + BACK];
        Self { writer, manner, content_type: JSON, buffer, filled: 0, begun: false }
    }

    /// What follows is of this type, not JSON.
    pub(super) fn content_type(&mut self, content_type: &'static str) {
        self.content_type = content_type;
    }

    /// Appends what `fill` writes, which says how long that is, or none where the room does not do.
    pub(super) async fn append(&mut self, fill: impl Fn(&mut [u8]) -> Option<usize>) -> Result<(), End> {
        if self.fill(&fill) {
            return Ok(());
        }
        let piece = self.piece(false);
        self.send(piece).await?;
        // No piece is so long, see the tests.
        if self.fill(&fill) { Ok(()) } else { Err(End::Broken) }
    }

    fn fill(&mut self, fill: impl Fn(&mut [u8]) -> Option<usize>) -> bool {
        let room = self.buffer.get_mut(FRONT + self.filled..FRONT + BODY).unwrap_or_default();
        let count = fill(room);
        self.filled += count.unwrap_or(0);
        count.is_some()
    }

    /// Appends text.
    pub(super) async fn put(&mut self, text: fmt::Arguments<'_>) -> Result<(), End> {
        self.append(|room| write(room, text)).await
    }

    /// Sends what is left.
    pub(super) async fn finish(&mut self) -> Result<(), End> {
        let rest = if self.begun { self.piece(true) } else { self.whole(status::OK, None) };
        self.send(rest).await
    }

    /// Sends one value.
    pub(super) async fn value(&mut self, value: &impl Serialize) -> Result<(), End> {
        self.append(|room| json(room, value)).await?;
        self.finish().await
    }

    /// Sends why there is nothing else; what has been appended is dropped.
    pub(super) async fn problem(&mut self, problem: &Problem) -> Result<(), End> {
        #[derive(Serialize)]
        struct Body<'a> {
            error: &'a Problem,
        }
        self.filled = 0;
        if !self.fill(|room| json(room, &Body { error: problem })) {
            return Err(End::Broken);
        }
        let allow = if let Problem::Method(methods) = problem { Some(*methods) } else { None };
        let whole = self.whole(problem.status(), allow);
        self.send(whole).await
    }

    /// Sends a file of the page.
    pub(super) async fn asset(&mut self, asset: &'static Asset) -> Result<(), End> {
        let manner = self.manner;
        self.fill(|room| {
            let mut head = Head::new(room, status::OK, asset.content_type, manner);
            head.field("Content-Security-Policy", POLICY);
            head.field("Content-Length", asset.content.len());
            head.end()
        });
        self.send(FRONT..FRONT + self.filled).await?;
        if manner.body { send(self.writer, asset.content).await } else { Ok(()) }
    }

    async fn send(&mut self, part: Range<usize>) -> Result<(), End> {
        send(self.writer, self.buffer.get(part).unwrap_or_default()).await
    }

    /// Puts the head before the body; where both are.
    fn whole(&mut self, status: Status, allow: Option<&'static str>) -> Range<usize> {
        let mut front = [0; FRONT];
        let mut head = Head::new(&mut front, status, self.content_type, self.manner);
        if let Some(methods) = allow {
            head.field("Allow", methods);
        }
        head.field("Content-Length", self.filled);
        let length = head.end().unwrap_or(0);
        let body = if self.manner.body { self.filled } else { 0 };
        self.before(front.get(..length).unwrap_or_default())..FRONT + body
    }

    /// Makes the body in the buffer a chunk, after the head where that is not sent yet; where all of it is.
    fn piece(&mut self, last: bool) -> Range<usize> {
        let mut front = [0; FRONT];
        let mut length = 0;
        if !self.begun {
            self.begun = true;
            self.manner.keep_alive &= self.manner.chunks;
            let mut head = Head::new(&mut front, status::OK, self.content_type, self.manner);
            if self.manner.chunks {
                head.field("Transfer-Encoding", "chunked");
            }
            length = head.end().unwrap_or(0);
        }
        let mut end = FRONT;
        if self.manner.body {
            end += self.filled;
            if self.manner.chunks {
                let room = front.get_mut(length..).unwrap_or_default();
                let size = (self.filled > 0).then(|| write(room, format_args!("{:X}\r\n", self.filled)));
                length += size.flatten().unwrap_or(0);
                end += self.after(last);
            }
        }
        self.filled = 0;
        self.before(front.get(..length).unwrap_or_default())..end
    }

    /// Puts `front` right before the body; where it begins.
    fn before(&mut self, front: &[u8]) -> usize {
        let start = FRONT.saturating_sub(front.len());
        if let Some(place) = self.buffer.get_mut(start..FRONT) {
            place.copy_from_slice(front);
        }
        start
    }

    /// Puts what ends the chunk behind the body; how long that is.
    fn after(&mut self, last: bool) -> usize {
        let back: &[u8] = match (self.filled > 0, last) {
            (true, false) => b"\r\n",
            (true, true) => b"\r\n0\r\n\r\n",
            (false, true) => b"0\r\n\r\n",
            (false, false) => b"",
        };
        let end = FRONT + self.filled;
        if let Some(place) = self.buffer.get_mut(end..end + back.len()) {
            place.copy_from_slice(back);
        }
        back.len()
    }
}

/// Hands all of it to the network, but does not wait until the client has acknowledged it.
pub(super) async fn send<W: Write>(writer: &mut W, bytes: &[u8]) -> Result<(), End> {
    match with_timeout(SLOW_READER, writer.write_all(bytes)).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) => Err(End::Broken),
        Err(_) => Err(End::Slow),
    }
}

/// Writes a value as JSON; its length, where it fits.
pub(super) fn json(room: &mut [u8], value: &impl Serialize) -> Option<usize> {
    serde_json_core::to_slice(value, room).ok()
}

fn write(room: &mut [u8], text: fmt::Arguments<'_>) -> Option<usize> {
    let mut cursor = Cursor { room, filled: 0 };
    cursor.write_fmt(text).ok()?;
    Some(cursor.filled)
}

/// The head of a reply.
struct Head<'a>(Result<Cursor<'a>, fmt::Error>);

impl<'a> Head<'a> {
    fn new(room: &'a mut [u8], status: Status, content_type: &str, manner: Manner) -> Self {
        let mut head = Self(Ok(Cursor { room, filled: 0 }));
        let Status(code, reason) = status;
        head.line(format_args!("HTTP/1.1 {code} {reason}\r\n"));
        head.field("Content-Type", content_type);
        head.field("Cache-Control", "no-store");
        head.field("X-Content-Type-Options", "nosniff");
        if !manner.keep_alive {
            head.field("Connection", "close");
        }
        head
    }

    fn line(&mut self, text: fmt::Arguments<'_>) {
        if let Ok(cursor) = &mut self.0
            && cursor.write_fmt(text).is_err()
        {
            self.0 = Err(fmt::Error);
        }
    }

    fn field(&mut self, name: &str, value: impl fmt::Display) {
        self.line(format_args!("{name}: {value}\r\n"));
    }

    /// Its length, where it fits. All do, see the tests.
    fn end(mut self) -> Option<usize> {
        self.line(format_args!("\r\n"));
        self.0.ok().map(|cursor| cursor.filled)
    }
}

struct Cursor<'a> {
    room: &'a mut [u8],
    filled: usize,
}

impl fmt::Write for Cursor<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let end = self.filled + text.len();
        self.room.get_mut(self.filled..end).ok_or(fmt::Error)?.copy_from_slice(text.as_bytes());
        self.filled = end;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
