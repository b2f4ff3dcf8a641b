//! The line dialects: each line is a Modbus ASCII frame or a console command, and gets one line back.

use core::pin::{Pin, pin};

use embassy_futures::select::{Either, select};
use embassy_time::with_timeout;
use embedded_io_async::{Read, Write};
use heapless::String;

use super::inbox::Inbox;
use super::{End, Gateway, Guest, console, idle, modbus_ascii, send};

/// Longest line: a Modbus ASCII frame.
const LINE: usize = puente_modbus::ascii::MAX_ADU;

/// One line back.
pub(super) type Reply = String<560>;

/// How far the next line has come. Where it asks for something it has been read: the line itself is not needed any more.
#[allow(clippy::large_enum_variant, reason = "there is no heap, and one lives at a time")]
enum Line<'g> {
    /// A command that needs the drives.
    Console(console::Task),
    /// A frame.
    Modbus(modbus_ascii::Task<'g>),
    /// Nothing is left to do.
    Done,
    /// It is still to arrive.
    Awaited,
}

pub(super) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    // The rest of a line that was too long is dropped.
    let mut skipping = false;
    loop {
        let mut line = next_line(gateway, guest, inbox, writer, &mut skipping).await;
        let served = match &mut line {
            Ok(Line::Console(task)) => command(gateway, guest, inbox, writer, task).await,
            Ok(Line::Modbus(task)) => frame(gateway, inbox, writer, task).await,
            Ok(Line::Done) => Ok(()),
            Ok(Line::Awaited) if inbox.ended() => Err(End::Closed),
            Ok(Line::Awaited) => with_timeout(idle(gateway), inbox.fill()).await.unwrap_or(Err(End::Idle)),
            Err(end) => Err(*end),
        };
        if let Err(end) = served {
            return end;
        }
    }
}

// Each of these has a reply of its own, so that no place for a client keeps room for a reply and for what a command waits
// for at once.

/// Takes the next line, and answers it where that needs no drive.
async fn next_line<'g, R: Read, W: Write>(
    gateway: &'g Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
    skipping: &mut bool,
) -> Result<Line<'g>, End> {
    let mut reply = Reply::new();
    let line = take_line(gateway, guest, inbox, skipping, &mut reply);
    answer(writer, &reply).await?;
    Ok(line)
}

/// Serves a command that needs the drives.
async fn command<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
    task: &mut console::Task,
) -> Result<(), End> {
    let outcome = meanwhile(inbox, pin!(console::finish(gateway, guest, task))).await?;
    let mut reply = Reply::new();
    console::tell(gateway, &outcome, &mut reply);
    answer(writer, &reply).await
}

/// Serves a Modbus ASCII frame.
async fn frame<R: Read, W: Write>(
    gateway: &Gateway,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
    task: &mut modbus_ascii::Task<'_>,
) -> Result<(), End> {
    let mut reply = Reply::new();
    meanwhile(inbox, pin!(modbus_ascii::finish(gateway, task, &mut reply))).await?;
    answer(writer, &reply).await
}

async fn answer<W: Write>(writer: &mut W, reply: &Reply) -> Result<(), End> {
    if reply.is_empty() { Ok(()) } else { send(writer, reply.as_bytes()).await }
}

const TOO_LONG: &str = "error too-long a line has at most 513 characters; this one was dropped\r\n";

/// Takes the first line that has arrived in whole; a last line needs no end.
fn take_line<'g, R: Read>(
    gateway: &'g Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    skipping: &mut bool,
    reply: &mut Reply,
) -> Line<'g> {
    let data = inbox.data();
    let end = data.iter().position(|byte| *byte == b'\n').map(|at| at + 1);
    let length = match end {
        Some(length) => length,
        None if inbox.ended() || inbox.full() => data.len(),
        None => return Line::Awaited,
    };
    if length == 0 {
        return Line::Awaited;
    }
    let line = data.get(..length).unwrap_or_default().trim_ascii();
    let task = if *skipping {
        None
    } else if line.len() > LINE {
        let _ = reply.push_str(TOO_LONG);
        None
    } else {
        let gone = inbox.ended();
        match line.first() {
            None => None,
            Some(b':') => modbus_ascii::begin(gateway, guest, gone, line, reply).map(Line::Modbus),
            Some(_) => console::begin(gateway, guest, gone, line, reply).map(Line::Console),
        }
    };
    *skipping = end.is_none();
    inbox.consume(length);
    task.unwrap_or(Line::Done)
}

/// Does some work. What arrives meanwhile is kept, and renews the client's leases.
async fn meanwhile<R: Read, T>(
    inbox: &mut Inbox<'_, R>,
    mut work: Pin<&mut impl Future<Output = T>>,
) -> Result<T, End> {
    loop {
        match select(work.as_mut(), inbox.fill()).await {
            Either::First(done) => return Ok(done),
            Either::Second(Ok(())) => {}
            Either::Second(Err(end)) => return Err(end),
        }
    }
}
