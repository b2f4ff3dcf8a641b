//! The sending of a reply: whole with its length where it fits the buffer, else in chunks (RFC 9112, section 7.1).

use core::fmt::{self, Write as _};

use embassy_time::with_timeout;
use embedded_io_async::Write;
use heapless::String;
use serde::Serialize;

use super::super::{End, SLOW_READER};
use super::page::{Asset, POLICY};
use super::problem::Problem;
use super::status::{self, Status};

/// Room before the body, for the head or the length of a chunk.
const FRONT: usize = 512;
/// Room for the body. The longest piece of a reply must fit: a bus with its statistics.
pub(super) const BODY: usize = 1536;
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

    /// Sends one value.
    pub(super) async fn value(&mut self, value: &impl Serialize) -> Result<(), End> {
        self.json(value).await?;
        self.finish().await
    }

    /// Sends why there is nothing else. Nothing may have been appended before.
    pub(super) async fn problem(&mut self, problem: &Problem) -> Result<(), End> {
        #[derive(Serialize)]
        struct Body<'a> {
            error: &'a Problem,
        }
        self.filled = 0;
        self.json(&Body { error: problem }).await?;
        let allow = if let Problem::Method(methods) = problem { Some(*methods) } else { None };
        self.whole(problem.status(), allow).await
    }

    /// Sends a file of the page.
    pub(super) async fn asset(&mut self, asset: &Asset) -> Result<(), End> {
        let mut head = Head::new(status::OK, asset.content_type, self.manner);
        head.field("Content-Security-Policy", POLICY);
        head.field("Content-Length", asset.content.len());
        send(self.writer, head.end()).await?;
        if self.manner.body { send(self.writer, asset.content).await } else { Ok(()) }
    }

    /// What follows is of this type, not JSON.
    pub(super) fn content_type(&mut self, content_type: &'static str) {
        self.content_type = content_type;
    }

    /// Appends a value as JSON.
    pub(super) async fn json(&mut self, value: &impl Serialize) -> Result<(), End> {
        self.append(|room| serde_json_core::to_slice(value, room).ok()).await
    }

    /// Appends text.
    pub(super) async fn put(&mut self, text: fmt::Arguments<'_>) -> Result<(), End> {
        self.append(|room| {
            let mut cursor = Cursor { room, filled: 0 };
            cursor.write_fmt(text).ok()?;
            Some(cursor.filled)
        })
        .await
    }

    /// Appends what `fill` writes; it says none where the room does not do.
    async fn append(&mut self, fill: impl Fn(&mut [u8]) -> Option<usize>) -> Result<(), End> {
        if let Some(count) = fill(self.room()) {
            self.filled += count;
            return Ok(());
        }
        self.piece(false).await?;
        match fill(self.room()) {
            Some(count) => self.filled += count,
            // No piece is so long, see the tests.
            None => return Err(End::Broken),
        }
        Ok(())
    }

    fn room(&mut self) -> &mut [u8] {
        self.buffer.get_mut(FRONT + self.filled..FRONT + BODY).unwrap_or_default()
    }

    /// Sends what is left.
    pub(super) async fn finish(&mut self) -> Result<(), End> {
        if self.begun { self.piece(true).await } else { self.whole(status::OK, None).await }
    }

    async fn whole(&mut self, status: Status, allow: Option<&'static str>) -> Result<(), End> {
        let mut head = Head::new(status, self.content_type, self.manner);
        if let Some(methods) = allow {
            head.field("Allow", methods);
        }
        head.field("Content-Length", self.filled);
        let length = if self.manner.body { self.filled } else { 0 };
        self.send(head.end(), length).await
    }

    async fn piece(&mut self, last: bool) -> Result<(), End> {
        let mut front = String::<FRONT>::new();
        if !self.begun {
            if !self.manner.chunks {
                self.manner.keep_alive = false;
            }
            let mut head = Head::new(status::OK, self.content_type, self.manner);
            if self.manner.chunks {
                head.field("Transfer-Encoding", "chunked");
            }
            front = head.0;
            let _ = front.push_str("\r\n");
            self.begun = true;
        }
        let mut length = 0;
        if self.manner.body {
            length = self.filled;
            if self.manner.chunks {
                length += self.frame(&mut front, last);
            }
        }
        self.filled = 0;
        self.send(front.as_bytes(), length).await
    }

    /// Makes the body in the buffer a chunk; how many bytes that adds behind it.
    fn frame(&mut self, front: &mut String<FRONT>, last: bool) -> usize {
        let mut back: &[u8] = if last { b"\r\n0\r\n\r\n" } else { b"\r\n" };
        if self.filled > 0 {
            // The room for it is part of FRONT, see the tests.
            let _ = write!(front, "{:X}\r\n", self.filled);
        } else {
            back = back.get(2..).unwrap_or_default();
        }
        let end = FRONT + self.filled;
        if let Some(place) = self.buffer.get_mut(end..end + back.len()) {
            place.copy_from_slice(back);
        }
        back.len()
    }

    /// Sends `front` and the first `length` bytes of the body as one.
    async fn send(&mut self, front: &[u8], length: usize) -> Result<(), End> {
        let start = FRONT.saturating_sub(front.len());
        if let Some(place) = self.buffer.get_mut(start..FRONT) {
            place.copy_from_slice(front);
        }
        send(self.writer, self.buffer.get(start..FRONT + length).unwrap_or_default()).await
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

/// The head of a reply. All that is written into it fits, see the tests.
struct Head(String<FRONT>);

impl Head {
    fn new(status: Status, content_type: &str, manner: Manner) -> Self {
        let mut head = Self(String::new());
        let Status(code, reason) = status;
        let _ = write!(head.0, "HTTP/1.1 {code} {reason}\r\n");
        head.field("Content-Type", content_type);
        head.field("Cache-Control", "no-store");
        head.field("X-Content-Type-Options", "nosniff");
        if !manner.keep_alive {
            head.field("Connection", "close");
        }
        head
    }

    fn field(&mut self, name: &str, value: impl fmt::Display) {
        let _ = write!(self.0, "{name}: {value}\r\n");
    }

    fn end(&mut self) -> &[u8] {
        let _ = self.0.push_str("\r\n");
        self.0.as_bytes()
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
