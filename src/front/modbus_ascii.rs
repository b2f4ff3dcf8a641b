//! A Modbus ASCII frame from a client, answered as Modbus ASCII whatever the line speaks.

use core::fmt::Write;
use core::future::poll_fn;

use puente_modbus::{FrameError, ascii};

use super::lines::Reply;
use super::modbus_tcp::{Flights, route};
use super::{Gateway, Guest};

/// A frame whose request is on its way.
pub(super) struct Task<'g> {
    unit: u8,
    flights: Flights<'g>,
}

/// Reads a frame and queues its request. What is no frame gets a line `error ...`, which a Modbus ASCII master passes
/// over; what is refused gets an exception; then there is no task.
pub(super) fn begin<'g>(
    gateway: &'g Gateway,
    guest: Guest,
    gone: bool,
    line: &[u8],
    reply: &mut Reply,
) -> Option<Task<'g>> {
    let frame = match ascii::parse(line) {
        Ok(frame) => frame,
        Err(error) => {
            let _ = write!(reply, "error {} {error}\r\n", code(error));
            return None;
        }
    };
    let mut task = Task { unit: frame.unit, flights: Flights::new() };
    // One flight a bus fits: the vector is as long as there can be buses.
    let take = |flight| task.flights.push(flight).is_ok();
    if let Err(exception) = route(gateway, guest, gone, frame.unit, &frame.pdu, take) {
        push(reply, frame.unit, &exception.pdu(frame.pdu.first().copied().unwrap_or_default()));
        return None;
    }
    Some(task)
}

/// Waits for the reply, where one is due: a broadcast has none.
pub(super) async fn finish(gateway: &Gateway, task: &mut Task<'_>, reply: &mut Reply) {
    let unit = task.unit;
    while let Some(flight) = task.flights.last_mut() {
        let broadcast = flight.broadcast;
        let mut write = |pdu: &[u8]| {
            if !broadcast {
                push(reply, unit, pdu);
            }
        };
        poll_fn(|context| flight.poll(context, &gateway.axes, &mut write)).await;
        task.flights.pop();
    }
}

fn push(reply: &mut Reply, unit: u8, pdu: &[u8]) {
    let frame = ascii::emit(unit, pdu);
    // A frame is ASCII and shorter than a reply line.
    let _ = core::str::from_utf8(&frame).map(|text| reply.push_str(text));
}

const fn code(error: FrameError) -> &'static str {
    match error {
        FrameError::Check { .. } => "bad-lrc",
        FrameError::NotHex { .. } => "not-hex",
        FrameError::OddDigits => "odd-digits",
        FrameError::TooShort => "too-short",
        FrameError::TooLong => "too-long",
    }
}
