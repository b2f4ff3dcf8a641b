//! A door where the gateway is a socketcand with its CANopen buses.

use embassy_futures::select::{Either3, select3};
use embedded_io_async::{Read, Write};
use heapless::Vec;
use puente_canopen::{Frame, Id};
use puente_line::Instant;
use puente_socketcand::{Message, Request, Texts};

use super::super::inbox::Inbox;
use super::super::{End, Gateway, Guest, idle, send};
use super::slcan::heard;
use crate::clock;
use crate::desk::{CanFollower, Heard, Lost, Origin, What};
use crate::settings::ClientFrames;

/// Identifiers that a client may subscribe to.
const SUBSCRIPTIONS: usize = 16;

/// A client, and the bus that it has opened.
struct Client<'g> {
    gateway: &'g Gateway,
    guest: Guest,
    bus: Option<u8>,
    follower: Option<CanFollower<'g>>,
    /// It wants all frames.
    raw: bool,
    subscriptions: Vec<Subscription, SUBSCRIPTIONS>,
}

/// In BCM mode: frames of an identifier, not more often than it is said.
struct Subscription {
    id: Id,
    micros: u64,
    last: Option<Instant>,
}

/// Serves a client until the visit is over.
pub(in crate::front) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    let subscriptions = Vec::new();
    let mut client = Client { gateway, guest, bus: None, follower: None, raw: false, subscriptions };
    client.attend(inbox, writer).await.unwrap_or_else(|end| end)
}

impl Client<'_> {
    async fn attend<R: Read, W: Write>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
    ) -> Result<End, End> {
        let mut texts = Texts::new();
        let patience = puente_line::Duration::from_micros(idle(self.gateway).as_micros());
        say(writer, &Message::Hi).await?;
        loop {
            while let Some(byte) = inbox.data().first().copied() {
                inbox.consume(1);
                if let Some(text) = texts.push(byte) {
                    let answer = match text.map(Request::parse) {
                        Some(Ok(request)) => self.obey(inbox.ended(), request).await,
                        _ => Some(Message::UNKNOWN),
                    };
                    if let Some(answer) = answer {
                        say(writer, &answer).await?;
                    }
                }
            }
            if inbox.ended() {
                return Ok(End::Closed);
            }
            // Who listens need not speak.
            let until = if self.follower.is_none() { Some(clock::now() + patience) } else { None };
            match select3(inbox.fill(), heard(&mut self.follower), clock::at(until)).await {
                Either3::First(filled) => filled?,
                Either3::Second(heard) => self.tell(writer, heard).await?,
                Either3::Third(()) => return Ok(End::Idle),
            }
        }
    }

    async fn obey(&mut self, gone: bool, request: Request<'_>) -> Option<Message<'static>> {
        Some(match request {
            Request::Open(name) => match self.named(name) {
                Some(bus) => {
                    self.bus = Some(bus);
                    self.follower = self.gateway.desk.follow_can(self.guest.seat, bus);
                    Message::Ok
                }
                None => Message::NO_BUS,
            },
            Request::Echo => Message::Echo,
            _ if self.bus.is_none() => Message::UNKNOWN,
            Request::RawMode | Request::BcmMode => {
                self.raw = request == Request::RawMode;
                Message::Ok
            }
            Request::Send(frame) => return self.send(gone, &frame).await.err(),
            Request::Subscribe { id, micros } => {
                self.subscriptions.retain(|known| known.id != id);
                let subscription = Subscription { id, micros, last: None };
                return self
                    .subscriptions
                    .push(subscription)
                    .is_err()
                    .then_some(Message::Error("too many subscriptions"));
            }
            Request::Unsubscribe(id) => {
                self.subscriptions.retain(|known| known.id != id);
                return None;
            }
            Request::Statistics(_) | Request::Unsupported => Message::UNKNOWN,
        })
    }

    /// The bus of a name in the settings; `can0` is the first one where none has that name.
    fn named(&self, name: &str) -> Option<u8> {
        let buses = &self.gateway.settings.buses;
        let all = || self.gateway.can_buses().map(|(bus, _)| bus);
        let of_name = |bus: &u8| buses.get(usize::from(*bus)).is_some_and(|bus| bus.name.as_str() == name);
        all().find(of_name).or_else(|| all().nth(name.strip_prefix("can")?.parse().ok()?))
    }

    /// Sends a frame, or tells why not.
    async fn send(&self, gone: bool, frame: &Frame) -> Result<(), Message<'static>> {
        let buses = &self.gateway.settings.buses;
        let bus = self.bus.ok_or(Message::NO_BUS)?;
        let canopen = buses.get(usize::from(bus)).and_then(|bus| bus.canopen());
        if canopen.is_none_or(|bus| bus.client_frames != ClientFrames::Write) {
            return Err(Message::Error("the bus is read-only"));
        }
        let sent = self.gateway.send_frame(self.guest, gone, bus, frame).await;
        sent.map_err(|_| Message::Error("not sent"))
    }

    /// Tells of a frame that another station has sent, or that the gateway or another client has.
    async fn tell<W: Write>(&mut self, writer: &mut W, heard: Result<Heard, Lost>) -> Result<(), End> {
        match heard {
            Ok(Heard { at, what: What::Frame { frame, origin } })
                if origin != Origin::Client(self.guest.seat) && self.wants(&frame, at) =>
            {
                say(writer, &Message::Frame { frame, micros: at.as_micros() }).await
            }
            _ => Ok(()),
        }
    }

    fn wants(&mut self, frame: &Frame, at: Instant) -> bool {
        if self.raw {
            return true;
        }
        let Some(known) = self.subscriptions.iter_mut().find(|known| known.id == frame.id()) else {
            return false;
        };
        let due = known.last.is_none_or(|last| at.as_micros() - last.as_micros() >= known.micros);
        if due {
            known.last = Some(at);
        }
        due
    }
}

/// Sends a message; what socketcand cannot say is left out.
async fn say<W: Write>(writer: &mut W, message: &Message<'_>) -> Result<(), End> {
    match message.emit() {
        Some(text) => send(writer, text.as_bytes()).await,
        None => Ok(()),
    }
}
