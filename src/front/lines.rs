//! The line dialects: each line is a Modbus ASCII frame, a console command, a CAN frame or a command of CiA 309-3, and gets its
//! answer before the next one is looked at.

use core::pin::{Pin, pin};

use embassy_futures::select::{Either, select};
use embedded_io_async::{Read, Write};
use heapless::String;

use super::can::{self, Last};
use super::inbox::Inbox;
use super::{End, Gateway, Guest, console, idle, modbus_ascii, send};
use crate::clock;

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
    /// What goes on a CAN bus.
    Can(can::Task),
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
    let patience = puente_line::Duration::from_micros(idle(gateway).as_micros());
    let mut client = can::Client::new(gateway, guest);
    loop {
        let mut line = next_line(gateway, guest, inbox, writer, &mut client, &mut skipping).await;
        let served = match &mut line {
            Ok(Line::Console(task)) => command(gateway, guest, inbox, writer, task).await,
            Ok(Line::Modbus(task)) => frame(gateway, inbox, writer, task).await,
            Ok(Line::Can(task)) => client.serve(inbox, writer, *task).await,
            Ok(Line::Done) => Ok(()),
            Ok(Line::Awaited) if inbox.ended() => Err(End::Closed),
            Ok(Line::Awaited) => client.listen(inbox, writer, clock::now() + patience).await,
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
    client: &mut can::Client<'g>,
    skipping: &mut bool,
) -> Result<Line<'g>, End> {
    let mut reply = Reply::new();
    let line = take_line(gateway, guest, inbox, client, skipping, &mut reply);
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
    client: &mut can::Client<'g>,
    skipping: &mut bool,
    reply: &mut Reply,
) -> Line<'g> {
    let data = inbox.data();
    let (length, whole) = match end(data) {
        Some(length) => (length, true),
        None if inbox.ended() || inbox.full() => (data.len(), inbox.ended()),
        None => return Line::Awaited,
    };
    if length == 0 {
        return Line::Awaited;
    }
    let all = data.get(..length).unwrap_or_default();
    let line = all.trim_ascii();
    let gone = inbox.ended();
    let (read, task) = match line.first() {
        _ if *skipping => (length, None),
        Some(b'[' | b'#' | b'0'..=b'9') => {
            let (read, task) = client.command(all, whole, reply);
            (read, task.map(Line::Can))
        }
        Some(_) if line.len() > LINE => {
            let _ = reply.push_str(TOO_LONG);
            (length, None)
        }
        None => {
            client.said_nothing(reply);
            (length, None)
        }
        Some(b'=') => (length, client.bridged(line, reply).map(Line::Can)),
        Some(b':') if line.contains(&b',') => (length, client.controlled(line, reply).map(Line::Can)),
        Some(b':') => {
            client.said(Last::Other);
            (length, modbus_ascii::begin(gateway, guest, gone, line, reply).map(Line::Modbus))
        }
        Some(_) => {
            client.said(Last::Other);
            (length, console::begin(gateway, guest, gone, line, reply).map(Line::Console))
        }
    };
    // A task takes what is left of its line.
    *skipping = !whole && task.is_none();
    inbox.consume(read);
    task.unwrap_or(Line::Done)
}

/// Where the first line ends: behind a line feed, or as its dialect has it.
fn end(data: &[u8]) -> Option<usize> {
    let ends: &[u8] = match data.iter().find(|byte| !matches!(byte, b' ' | b'\t')) {
        // What is left of the last one, which a carriage return has ended.
        Some(b'\r') if data.iter().any(|byte| !byte.is_ascii_whitespace()) => b"\r\n",
        Some(b'=') => b"X\r\n",
        Some(b':') => b"\r\n",
        _ => b"\n",
    };
    data.iter().position(|byte| ends.contains(byte)).map(|at| at + 1)
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
