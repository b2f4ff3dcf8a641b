//! The line dialects: each line is a Modbus ASCII frame or a console command, and gets one line back.

use core::pin::pin;

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

/// What a line asks for, after it was read: the line itself is not needed any more.
#[allow(clippy::large_enum_variant, reason = "there is no heap, and one lives at a time")]
enum Task<'g> {
    Console(console::Task),
    Modbus(modbus_ascii::Task<'g>),
}

/// How far the next line has come.
enum Line<'g> {
    /// It asks for this.
    Task(Task<'g>),
    /// It has been read. Nothing is left to do but to send the reply, if there is any.
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
        let served = serve_line(gateway, guest, inbox, writer, &mut skipping).await;
        if let Err(end) = served {
            return end;
        }
    }
}

/// Serves one line, or waits for more of it. A reply and what a command waits for are never there at once: they share
/// their room, of which every place for a client has one.
async fn serve_line<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
    skipping: &mut bool,
) -> Result<(), End> {
    let task = {
        let mut reply = Reply::new();
        match take_line(gateway, guest, inbox, skipping, &mut reply) {
            Line::Task(task) => task,
            Line::Done => return answer(writer, &reply).await,
            Line::Awaited if inbox.ended() => return Err(End::Closed),
            Line::Awaited => {
                return with_timeout(idle(gateway), inbox.fill()).await.unwrap_or(Err(End::Idle));
            }
        }
    };
    match task {
        Task::Console(task) => {
            let outcome = meanwhile(inbox, console::finish(gateway, guest, task)).await?;
            let mut reply = Reply::new();
            console::tell(gateway, &outcome, &mut reply);
            answer(writer, &reply).await
        }
        Task::Modbus(mut task) => {
            let mut reply = Reply::new();
            meanwhile(inbox, modbus_ascii::finish(gateway, &mut task, &mut reply)).await?;
            answer(writer, &reply).await
        }
    }
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
            Some(b':') => modbus_ascii::begin(gateway, guest, gone, line, reply).map(Task::Modbus),
            Some(_) => console::begin(gateway, guest, gone, line, reply).map(Task::Console),
        }
    };
    *skipping = end.is_none();
    inbox.consume(length);
    task.map_or(Line::Done, Line::Task)
}

/// Does some work. What arrives meanwhile is kept, and renews the client's leases.
async fn meanwhile<R: Read, T>(inbox: &mut Inbox<'_, R>, work: impl Future<Output = T>) -> Result<T, End> {
    let mut work = pin!(work);
    loop {
        match select(work.as_mut(), inbox.fill()).await {
            Either::First(done) => return Ok(done),
            Either::Second(Ok(())) => {}
            Either::Second(Err(end)) => return Err(end),
        }
    }
}
