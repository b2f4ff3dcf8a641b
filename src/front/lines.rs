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
    /// Nothing is left to do but to send the reply.
    Done,
}

pub(super) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    // The rest of a line that was too long is dropped.
    let mut skipping = false;
    let mut reply = Reply::new();
    loop {
        reply.clear();
        let mut line = take_line(gateway, guest, inbox, &mut skipping, &mut reply);
        match &mut line {
            Some(task) => {
                if let Err(end) = carry_out(gateway, guest, inbox, task, &mut reply).await {
                    return end;
                }
            }
            None if inbox.ended() => return End::Closed,
            None => match with_timeout(idle(gateway), inbox.fill()).await {
                Ok(Ok(())) => continue,
                Ok(Err(end)) => return end,
                Err(_) => return End::Idle,
            },
        }
        if !reply.is_empty()
            && let Err(end) = send(writer, reply.as_bytes()).await
        {
            return end;
        }
    }
}

const TOO_LONG: &str = "error too-long a line has at most 513 characters; this one was dropped\r\n";

/// Takes the first line that has arrived in whole; a last line needs no end. None where there is none.
fn take_line<'g, R: Read>(
    gateway: &'g Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    skipping: &mut bool,
    reply: &mut Reply,
) -> Option<Task<'g>> {
    let data = inbox.data();
    let end = data.iter().position(|byte| *byte == b'\n').map(|at| at + 1);
    let length = match end {
        Some(length) => length,
        None if inbox.ended() || inbox.full() => data.len(),
        None => return None,
    };
    if length == 0 {
        return None;
    }
    let line = data.get(..length).unwrap_or_default().trim_ascii();
    let task = if *skipping {
        Task::Done
    } else if line.len() > LINE {
        let _ = reply.push_str(TOO_LONG);
        Task::Done
    } else {
        let gone = inbox.ended();
        match line.first() {
            None => Task::Done,
            Some(b':') => Task::Modbus(modbus_ascii::begin(gateway, guest, gone, line, reply)),
            Some(_) => Task::Console(console::begin(gateway, guest, gone, line, reply)),
        }
    };
    *skipping = end.is_none();
    inbox.consume(length);
    Some(task)
}

/// Does what a line asks for. What arrives meanwhile is kept, and renews the client's leases.
async fn carry_out<R: Read>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    task: &mut Task<'_>,
    reply: &mut Reply,
) -> Result<(), End> {
    let mut work = pin!(async {
        match task {
            Task::Console(task) => console::finish(gateway, guest, *task, reply).await,
            Task::Modbus(task) => modbus_ascii::finish(gateway, task, reply).await,
            Task::Done => {}
        }
    });
    loop {
        match select(work.as_mut(), inbox.fill()).await {
            Either::First(()) => return Ok(()),
            Either::Second(Ok(())) => {}
            Either::Second(Err(end)) => return Err(end),
        }
    }
}
