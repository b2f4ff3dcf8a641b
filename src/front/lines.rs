//! The line dialects: each line is a Modbus ASCII frame or a console command, and gets one line back.

use core::pin::pin;

use embassy_futures::select::{Either, select};
use embassy_time::with_timeout;
use embedded_io_async::{Read, Write};
use heapless::{String, Vec};

use super::inbox::Inbox;
use super::{End, Gateway, Guest, console, idle, modbus_ascii, send};

/// Longest line: a Modbus ASCII frame.
const LINE: usize = puente_modbus::ascii::MAX_ADU;

/// One line back.
pub(super) type Reply = String<768>;

pub(super) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    let mut skipping = false;
    loop {
        let (line, length) = match next_line(inbox) {
            Some(found) => found,
            None if inbox.ended() => return End::Closed,
            None => {
                if inbox.full() {
                    inbox.consume(inbox.data().len());
                    if !skipping && let Err(end) = send(writer, TOO_LONG).await {
                        return end;
                    }
                    skipping = true;
                }
                match with_timeout(idle(gateway), inbox.fill()).await {
                    Ok(Ok(())) => continue,
                    Ok(Err(end)) => return end,
                    Err(_) => return End::Idle,
                }
            }
        };
        inbox.consume(length);
        if core::mem::take(&mut skipping) {
            // The end of a line that has been refused already.
            continue;
        }
        let Some(line) = line else {
            match send(writer, TOO_LONG).await {
                Ok(()) => continue,
                Err(end) => return end,
            }
        };
        let reply = match answer(gateway, guest, inbox, &line).await {
            Ok(reply) => reply,
            Err(end) => return end,
        };
        if !reply.is_empty()
            && let Err(end) = send(writer, reply.as_bytes()).await
        {
            return end;
        }
    }
}

const TOO_LONG: &[u8] = b"error too-long a line has at most 513 characters; this one was dropped\r\n";

/// The first line that has arrived in whole and how many bytes it takes with its end. A last line needs no end. No
/// text where it is too long.
fn next_line<R: Read>(inbox: &Inbox<'_, R>) -> Option<(Option<Vec<u8, LINE>>, usize)> {
    let data = inbox.data();
    let length = match data.iter().position(|byte| *byte == b'\n') {
        Some(at) => at + 1,
        None if inbox.ended() && !data.is_empty() => data.len(),
        None => return None,
    };
    let line = data.get(..length).unwrap_or_default().trim_ascii();
    Some((Vec::from_slice(line).ok(), length))
}

/// Carries out one line. What arrives meanwhile is kept, and renews the client's leases.
async fn answer<R: Read>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    line: &[u8],
) -> Result<Reply, End> {
    let gone = inbox.ended();
    let mut work = pin!(async {
        match line.first() {
            None => Reply::new(),
            Some(b':') => modbus_ascii::answer(gateway, guest, gone, line).await,
            Some(_) => console::answer(gateway, guest, gone, line).await,
        }
    });
    loop {
        match select(work.as_mut(), inbox.fill()).await {
            Either::First(reply) => return Ok(reply),
            Either::Second(Ok(())) => {}
            Either::Second(Err(end)) => return Err(end),
        }
    }
}
