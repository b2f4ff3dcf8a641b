//! The sending of a reply: whole with its length where it fits the buffer, else in chunks (RFC 9112, section 7.1).

use core::fmt::{self, Write as _};

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embedded_io_async::Write;
use serde::Serialize;
use static_cell::ConstStaticCell;

use super::super::{End, send};
use super::page::{Asset, POLICY};
use super::problem::{BadSettings, Problem};
use super::status::{self, Status};
use crate::port::limits::SHEETS;
use crate::settings;

/// Room before the body, for the head or the length of a chunk. The longest head is that of the page.
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

/// What a reply is written on.
pub struct Sheet([u8; FRONT + BODY + BACK]);

/// The sheets of the gateway, fewer than clients: a reply needs one only while it is written and sent. What a request
/// asks for has been done before, so that a stop never waits for a sheet.
pub struct Sheets(Channel<CriticalSectionRawMutex, &'static mut Sheet, SHEETS>);

impl Sheets {
    /// All of them. Call it once.
    pub fn new() -> Self {
        static ALL: ConstStaticCell<[Sheet; SHEETS]> =
            ConstStaticCell::new([const { Sheet([0; FRONT + BODY + BACK]) }; SHEETS]);
        let sheets = Channel::new();
        for sheet in ALL.take() {
            // There is room for all.
            let _ = sheets.try_send(sheet);
        }
        Self(sheets)
    }

    /// How many nobody uses now.
    pub(in crate::front) fn free(&self) -> usize {
        self.0.len()
    }

    /// One of them, when there is one.
    pub(in crate::front) async fn lend(&self) -> Lent<'_> {
        Lent { from: self, sheet: Some(self.0.receive().await) }
    }
}

/// A sheet that goes back when it is dropped.
pub(in crate::front) struct Lent<'s> {
    from: &'s Sheets,
    sheet: Option<&'static mut Sheet>,
}

impl Lent<'_> {
    /// All of it.
    pub(in crate::front) fn bytes(&mut self) -> &mut [u8] {
        self.sheet.as_mut().map_or(&mut [], |sheet| &mut sheet.0)
    }
}

impl Drop for Lent<'_> {
    fn drop(&mut self) {
        if let Some(sheet) = self.sheet.take() {
            let _ = self.from.0.try_send(sheet);
        }
    }
}

/// A reply on its way.
pub(super) struct Reply<'w, W> {
    writer: &'w mut W,
    sheets: &'w Sheets,
    /// None until something is written.
    sheet: Option<Lent<'w>>,
    pub manner: Manner,
    content_type: &'static str,
    /// Bytes of the body on the sheet.
    filled: usize,
    /// The head is sent, and pieces follow.
    begun: bool,
}

impl<'w, W: Write> Reply<'w, W> {
    pub(super) fn new(writer: &'w mut W, sheets: &'w Sheets, manner: Manner) -> Self {
        Self { writer, sheets, sheet: None, manner, content_type: JSON, filled: 0, begun: false }
    }

    /// Waits for a sheet to write on.
    async fn start(&mut self) {
        if self.sheet.is_none() {
            self.sheet = Some(self.sheets.lend().await);
        }
    }

    fn bytes(&mut self) -> &mut [u8] {
        self.sheet.as_mut().map_or(&mut [], Lent::bytes)
    }

    /// Sends one value.
    pub(super) async fn value(&mut self, value: &impl Serialize) -> Result<(), End> {
        self.json(value).await?;
        self.finish().await
    }

    /// Sends why there is nothing else. Nothing may have been appended before.
    pub(super) async fn problem(&mut self, problem: &Problem) -> Result<(), End> {
        let allow = if let Problem::Method(methods) = problem { Some(*methods) } else { None };
        self.error(problem.status(), problem, allow).await
    }

    /// Sends what is wrong with a settings document.
    pub(super) async fn bad_settings(&mut self, problem: &settings::Problem) -> Result<(), End> {
        self.error(status::BAD_REQUEST, &BadSettings(problem), None).await
    }

    async fn error(
        &mut self,
        status: Status,
        error: &impl Serialize,
        allow: Option<&'static str>,
    ) -> Result<(), End> {
        #[derive(Serialize)]
        struct Body<'a, E> {
            error: &'a E,
        }
        self.filled = 0;
        self.json(&Body { error }).await?;
        self.whole(status, allow).await
    }

    /// Sends a file of the page.
    pub(super) async fn asset(&mut self, asset: &Asset) -> Result<(), End> {
        self.content_type = asset.content_type;
        self.start().await;
        let start = self.head(status::OK, |head| {
            head.field("Content-Security-Policy", POLICY);
            head.field("Content-Length", asset.content.len());
        });
        self.send(start, 0).await?;
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

    /// Appends what `take` puts into the room that is left; where it takes nothing the next room is larger.
    pub(super) async fn take(&mut self, mut take: impl FnMut(&mut [u8]) -> usize) -> Result<(), End> {
        self.start().await;
        let count = take(self.room());
        self.filled += count;
        if count == 0 && self.filled > 0 { self.piece(false).await } else { Ok(()) }
    }

    /// Appends what `fill` writes; it says none where the room does not do, and is asked again with more.
    pub(super) async fn append(&mut self, fill: impl Fn(&mut [u8]) -> Option<usize>) -> Result<(), End> {
        self.start().await;
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
        let from = FRONT + self.filled;
        self.bytes().get_mut(from..FRONT + BODY).unwrap_or_default()
    }

    /// Sends what is left.
    pub(super) async fn finish(&mut self) -> Result<(), End> {
        if self.begun { self.piece(true).await } else { self.whole(status::OK, None).await }
    }

    async fn whole(&mut self, status: Status, allow: Option<&'static str>) -> Result<(), End> {
        let filled = self.filled;
        let start = self.head(status, |head| {
            if let Some(methods) = allow {
                head.field("Allow", methods);
            }
            head.field("Content-Length", filled);
        });
        self.send(start, if self.manner.body { filled } else { 0 }).await
    }

    async fn piece(&mut self, last: bool) -> Result<(), End> {
        let mut length = self.filled;
        let mut start = FRONT;
        if !self.manner.body {
            length = 0;
        } else if self.manner.chunks {
            start = self.chunk_front();
            length += self.chunk_back(last);
        }
        if !self.begun {
            if !self.manner.chunks {
                self.manner.keep_alive = false;
            }
            let chunks = self.manner.chunks;
            start = self.head_before(start, status::OK, |head| {
                if chunks {
                    head.field("Transfer-Encoding", "chunked");
                }
            });
            self.begun = true;
        }
        self.filled = 0;
        self.send(start, length).await
    }

    /// Writes the length of the body as a chunk before it; where that begins. An empty chunk would end the reply.
    fn chunk_front(&mut self) -> usize {
        if self.filled == 0 {
            return FRONT;
        }
        let filled = self.filled;
        self.before(FRONT, |front| write!(front, "{filled:X}\r\n"))
    }

    /// Writes what ends the chunk behind it; how many bytes that are.
    fn chunk_back(&mut self, last: bool) -> usize {
        let back: &[u8] = match (self.filled > 0, last) {
            (true, true) => b"\r\n0\r\n\r\n",
            (true, false) => b"\r\n",
            (false, true) => b"0\r\n\r\n",
            (false, false) => b"",
        };
        let end = FRONT + self.filled;
        if let Some(place) = self.bytes().get_mut(end..end + back.len()) {
            place.copy_from_slice(back);
        }
        back.len()
    }

    /// Writes the head before the body; where it begins.
    fn head(&mut self, status: Status, fields: impl FnOnce(&mut Head<'_, '_>)) -> usize {
        self.head_before(FRONT, status, fields)
    }

    fn head_before(
        &mut self,
        end: usize,
        Status(code, reason): Status,
        fields: impl FnOnce(&mut Head<'_, '_>),
    ) -> usize {
        let (content_type, keep_alive) = (self.content_type, self.manner.keep_alive);
        self.before(end, |cursor| {
            let mut head = Head(cursor);
            let _ = write!(head.0, "HTTP/1.1 {code} {reason}\r\n");
            head.field("Content-Type", content_type);
            head.field("Cache-Control", "no-store");
            head.field("X-Content-Type-Options", "nosniff");
            if !keep_alive {
                head.field("Connection", "close");
            }
            fields(&mut head);
            write!(head.0, "\r\n")
        })
    }

    /// Writes text so that it ends at `end`; where it begins. All that is written before the body fits, see the tests.
    fn before(&mut self, end: usize, write: impl FnOnce(&mut Cursor<'_>) -> fmt::Result) -> usize {
        let mut cursor = Cursor { room: self.bytes().get_mut(..end).unwrap_or_default(), filled: 0 };
        let _ = write(&mut cursor);
        let length = cursor.filled;
        self.bytes().copy_within(..length, end - length);
        end - length
    }

    /// Sends what stands before the body from `start` on, and the first `length` bytes of the body.
    async fn send(&mut self, start: usize, length: usize) -> Result<(), End> {
        let Some(sheet) = self.sheet.as_ref().and_then(|lent| lent.sheet.as_ref()) else {
            return Ok(());
        };
        send(self.writer, sheet.0.get(start..FRONT + length).unwrap_or_default()).await
    }
}

/// The head of a reply.
struct Head<'c, 'a>(&'c mut Cursor<'a>);

impl Head<'_, '_> {
    fn field(&mut self, name: &str, value: impl fmt::Display) {
        let _ = write!(self.0, "{name}: {value}\r\n");
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
