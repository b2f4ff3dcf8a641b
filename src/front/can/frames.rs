//! Controller mode and bridge mode: a message is a frame for the bus, and what nodes say comes back as messages.

use core::fmt::Write as _;
use core::pin::pin;

use embedded_io_async::{Read, Write};
use heapless::String;
use puente_canopen::Frame;
use puente_canopen::cob::Function;
use puente_canopen::frame::MAX_DATA;
use puente_frametext::{Mistake, Mode};

use super::super::inbox::Inbox;
use super::super::lines::Reply;
use super::super::{End, send};
use super::{Client, Last, Task, Work};

impl Client<'_> {
    /// The bus of frames: the network that the client has set, or the first one.
    pub(super) fn frame_bus(&self) -> Option<u8> {
        match self.session.net {
            Some(net) => self.gateway.can_bus(net),
            None => self.gateway.can_buses().next().map(|(bus, _)| bus),
        }
    }

    /// Reads a message of the controller mode. One that is none is answered by a line.
    pub(in crate::front) fn controlled(&mut self, line: &[u8], reply: &mut Reply) -> Option<Task> {
        self.message(Mode::Controller, line.strip_prefix(b":").unwrap_or(line), reply)
    }

    /// The same of the bridge mode.
    pub(in crate::front) fn bridged(&mut self, line: &[u8], reply: &mut Reply) -> Option<Task> {
        match line.strip_prefix(b"=").and_then(|text| text.strip_suffix(b"X")) {
            Some(text) => self.message(Mode::Bridge, text, reply),
            None => refuse(reply, Mistake::Parts.code(), "a message that begins with '=' ends with 'X'"),
        }
    }

    fn message(&mut self, mode: Mode, text: &[u8], reply: &mut Reply) -> Option<Task> {
        self.said(Last::Frame(mode));
        match (puente_frametext::parse(text), self.frame_bus()) {
            (Err(mistake), _) => refuse(reply, mistake.code(), mistake),
            (Ok(_), None) => refuse(reply, "unknown-bus", "there is no CANopen bus"),
            (Ok(frame), Some(bus)) => Some(Task { bus, work: Work::Frame(whole(frame)) }),
        }
    }

    /// Sends a frame. Only that it was not sent is told.
    pub(super) async fn send_frame<R: Read, W: Write>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
        bus: u8,
        frame: &Frame,
    ) -> Result<(), End> {
        let gone = inbox.ended();
        let sending = pin!(self.gateway.send_frame(self.guest, gone, bus, frame));
        if let Err(why) = Self::during(inbox, sending).await? {
            let mut line = String::<192>::new();
            let _ = write!(line, "error {} {why}\r\n", why.code());
            send(writer, line.as_bytes()).await?;
        }
        Ok(())
    }
}

fn refuse(reply: &mut Reply, code: &str, text: impl core::fmt::Display) -> Option<Task> {
    let _ = write!(reply, "error {code} {text}\r\n");
    None
}

/// An SDO has eight bytes (CiA 301, 7.2.4.3); the document leaves zeros at their end away, and servers pass such frames over.
fn whole(frame: Frame) -> Frame {
    match Function::of(frame.id()) {
        Some(Function::SdoRequest(_)) if !frame.is_remote() => {
            let mut bytes = [0; MAX_DATA];
            bytes.iter_mut().zip(frame.data()).for_each(|(to, from)| *to = *from);
            Frame::full(frame.id(), bytes)
        }
        _ => frame,
    }
}
