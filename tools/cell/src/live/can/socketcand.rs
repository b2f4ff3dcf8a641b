//! A socketcand: one bus, whatever a client calls it.

use puente_canopen::Id;
use puente_line::{Instant, micros};
use puente_socketcand::{BadRequest, Message, Request, Texts};

use crate::can::Cell;
use crate::can::bus::Heard;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    /// No bus has been opened.
    Closed,
    /// What is subscribed to.
    Bcm,
    /// Everything.
    Raw,
}

/// The server of one client.
pub struct Socketcand {
    texts: Texts,
    mode: Mode,
    /// Identifiers, at most how often, and when they were told last; times in us.
    subscriptions: Vec<(Id, u64, Option<u64>)>,
}

impl Socketcand {
    /// It greets its client.
    pub fn new(outbox: &mut Vec<u8>) -> Self {
        say(Message::Hi, outbox);
        Self { texts: Texts::new(), mode: Mode::Closed, subscriptions: Vec::new() }
    }

    /// Takes a byte of the client.
    pub fn take(&mut self, byte: u8, cell: &mut Cell, port: usize, now: Instant, outbox: &mut Vec<u8>) {
        // The text stays there, apart from what a request changes.
        let mut texts = std::mem::take(&mut self.texts);
        if let Some(text) = texts.push(byte) {
            self.answer(text.map(Request::parse), cell, port, now, outbox);
        }
        self.texts = texts;
    }

    fn answer(
        &mut self,
        request: Option<Result<Request<'_>, BadRequest>>,
        cell: &mut Cell,
        port: usize,
        now: Instant,
        outbox: &mut Vec<u8>,
    ) {
        let answer = match (request, self.mode) {
            (Some(Ok(Request::Open(_))), Mode::Closed) => {
                self.mode = Mode::Bcm;
                Message::Ok
            }
            (Some(Ok(Request::Echo)), _) => Message::Echo,
            (Some(Ok(_)), Mode::Closed) | (None | Some(Err(_)), _) => Message::UNKNOWN,
            (Some(Ok(request)), _) => match self.obey(request, cell, port, now) {
                Some(answer) => answer,
                None => return,
            },
        };
        say(answer, outbox);
    }

    fn obey(
        &mut self,
        request: Request<'_>,
        cell: &mut Cell,
        port: usize,
        now: Instant,
    ) -> Option<Message<'static>> {
        match request {
            Request::RawMode => self.mode = Mode::Raw,
            Request::BcmMode => self.mode = Mode::Bcm,
            Request::Send(frame) => {
                cell.send(now, port, &frame);
                return None;
            }
            Request::Subscribe { id, micros } => {
                self.subscriptions.retain(|(subscribed, ..)| *subscribed != id);
                self.subscriptions.push((id, micros, None));
                return None;
            }
            Request::Unsubscribe(id) => {
                self.subscriptions.retain(|(subscribed, ..)| *subscribed != id);
                return None;
            }
            Request::Open(_) | Request::Echo | Request::Statistics(_) | Request::Unsupported => {
                return Some(Message::UNKNOWN);
            }
        }
        Some(Message::Ok)
    }

    /// A frame has been on the bus.
    pub fn tell(&mut self, heard: &Heard, outbox: &mut Vec<u8>) {
        let at = micros(heard.at.since(Instant::ZERO));
        let wanted = match self.mode {
            Mode::Closed => false,
            Mode::Raw => true,
            Mode::Bcm => self.is_due(heard.frame.id(), at),
        };
        if wanted {
            say(Message::Frame { frame: heard.frame, micros: at }, outbox);
        }
    }

    fn is_due(&mut self, id: Id, at: u64) -> bool {
        let found = self.subscriptions.iter_mut().find(|(subscribed, ..)| *subscribed == id);
        let Some((_, every, last)) = found else { return false };
        let due = last.is_none_or(|last| at.saturating_sub(last) >= *every);
        if due {
            *last = Some(at);
        }
        due
    }
}

/// Remote frames cannot be said.
fn say(message: Message<'_>, outbox: &mut Vec<u8>) {
    outbox.extend(message.emit().map(|text| text.as_bytes().to_vec()).unwrap_or_default());
}
