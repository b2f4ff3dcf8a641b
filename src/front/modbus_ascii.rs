//! A Modbus ASCII frame from a client, answered as Modbus ASCII whatever the line speaks.

use core::fmt::Write;

use puente_modbus::{FrameError, ascii};

use super::lines::Reply;
use super::modbus_tcp::route;
use super::{Gateway, Guest};

/// The reply frame; empty after a broadcast. What is no frame gets a line `error ...`, which a Modbus ASCII master
/// passes over.
pub(super) async fn answer(gateway: &Gateway, guest: Guest, gone: bool, line: &[u8]) -> Reply {
    let frame = match ascii::parse(line) {
        Ok(frame) => frame,
        Err(error) => return refusal(error),
    };
    let function = frame.pdu.first().copied().unwrap_or_default();
    let mut reply = Reply::new();
    match route(gateway, guest, gone, frame.unit, &frame.pdu) {
        Err(exception) => push(&mut reply, frame.unit, &exception.pdu(function)),
        Ok(flights) => {
            for flight in flights {
                let broadcast = flight.broadcast;
                let ended = flight.ended(&gateway.axes).await;
                match ended {
                    _ if broadcast => {}
                    Ok(pdu) => push(&mut reply, frame.unit, &pdu),
                    Err(exception) => push(&mut reply, frame.unit, &exception.pdu(function)),
                }
            }
        }
    }
    reply
}

fn push(reply: &mut Reply, unit: u8, pdu: &[u8]) {
    let frame = ascii::emit(unit, pdu);
    // A frame is ASCII and shorter than a reply line.
    let _ = core::str::from_utf8(&frame).map(|text| reply.push_str(text));
}

fn refusal(error: FrameError) -> Reply {
    let code = match error {
        FrameError::Check { .. } => "bad-lrc",
        FrameError::NotHex { .. } => "not-hex",
        FrameError::OddDigits => "odd-digits",
        FrameError::TooShort => "too-short",
        FrameError::TooLong => "too-long",
    };
    let mut reply = Reply::new();
    let _ = write!(reply, "error {code} {error}\r\n");
    reply
}
