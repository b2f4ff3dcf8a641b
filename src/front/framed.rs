//! The framed bus: a client's frames go on the line as if it were a station there, and those for it come back.
//!
//! One frame after the other is passed on, each when it is whole; of one that was not sent the client hears by a negative
//! acknowledgement. Bytes between frames are passed over.

mod search;

use core::pin::{Pin, pin};

use embassy_futures::select::{Either3, select3};
use embassy_time::with_timeout;
use embedded_io_async::{Read, Write};
use heapless::Vec;
use puente_framed::arbiter::Failure;
use puente_framed::frame::{self, Kind};
use puente_framed::section::{self, NOBODY, TRAILER};
use puente_framed::{Reason, Session};
use puente_line::{Duration, Instant};

use super::http::{Sheet, Sheets};
use super::inbox::Inbox;
use super::{End, Gateway, Guest, idle, send};
use crate::axis::FrameRuling;
use crate::bus::Undelivered;
use crate::clock;
use crate::desk::{Follower, Turn};
use search::{Found, search};

/// A frame that has begun goes on before its client has been silent for so long, or it is none. Who has closed its side
/// gets what it is answered for so long.
const PAUSE: Duration = Duration::from_secs(1);
/// What has no room before it is its turn has so long to be whole then, for others wait.
const REST: embassy_time::Duration = embassy_time::Duration::from_millis(200);
/// Bytes of a refusal: one section, with one byte at most.
const REFUSAL: usize = section::OVERHEAD + 1 + frame::TAGGED_OVERHEAD;

/// A connection, apart from what it has sent.
struct Client<'g, 'w, W> {
    gateway: &'g Gateway,
    guest: Guest,
    /// The bus; without one everything is refused.
    bus: Option<u8>,
    /// The gateway's address there.
    station: u8,
    follower: Follower<'g>,
    writer: &'w mut W,
    /// The address that it has given last as its own.
    name: u8,
    /// A frame of its has been on the line.
    asked: bool,
}

/// Serves the framed dialect until the visit is over.
pub(super) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    let bus = gateway.desk.framed_bus();
    let framed = bus.and_then(|bus| gateway.settings.buses.get(usize::from(bus))?.framed());
    let station = framed.map_or(NOBODY, |framed| framed.station);
    let follower = gateway.desk.follow_bus(guest.seat);
    let mut client = Client { gateway, guest, bus, station, follower, writer, name: station, asked: false };
    client.attend(inbox).await.unwrap_or_else(|end| end)
}

/// What a refusal tells of a frame.
#[derive(Clone, Copy)]
struct Subject {
    origin: u8,
    lrc: u8,
}

impl Subject {
    /// Of a frame, or of what was taken for one.
    fn of(frame: &[u8]) -> Self {
        let byte = |at: usize| frame.get(at).copied().unwrap_or_default();
        Self { origin: byte(1), lrc: byte(frame.len().saturating_sub(2)) }
    }
}

impl<'g, W: Write> Client<'g, '_, W> {
    async fn attend<R: Read>(&mut self, inbox: &mut Inbox<'_, R>) -> Result<End, End> {
        let mut said = clock::now();
        // So many bytes belong to what was taken for a frame and has been refused. There may be frames among them.
        let mut refused: usize = 0;
        loop {
            let done = match search(inbox.data()) {
                Found::Garbage(count) => count,
                Found::Frame(length) => {
                    self.pass_on(inbox, length).await?;
                    said = clock::now();
                    0
                }
                // The rest has no room yet.
                Found::Partial(length) if inbox.full() => {
                    self.pass_on(inbox, length).await?;
                    said = clock::now();
                    0
                }
                Found::Nothing => {
                    let patience = match inbox.ended() {
                        false => duration(idle(self.gateway)),
                        // What it has asked may still be answered.
                        true if self.asked => PAUSE,
                        true => Duration::ZERO,
                    };
                    if !self.listen(inbox, said + patience).await? {
                        return Ok(if inbox.ended() { End::Closed } else { End::Idle });
                    }
                    said = clock::now();
                    0
                }
                Found::Partial(_) if !inbox.ended() && self.listen(inbox, said + PAUSE).await? => {
                    said = clock::now();
                    0
                }
                // It will not be whole.
                Found::Partial(length) | Found::Damaged(length) => {
                    if refused == 0 {
                        let bytes = inbox.data();
                        self.refuse(Subject::of(bytes.get(..length).unwrap_or(bytes)), Reason::Meaningless)
                            .await?;
                        refused = length;
                    }
                    1
                }
            };
            inbox.consume(done);
            refused = refused.saturating_sub(done);
        }
    }
    /// Waits for more from the client, until some moment; false where nothing comes.
    async fn listen<R: Read>(&mut self, inbox: &mut Inbox<'_, R>, until: Instant) -> Result<bool, End> {
        loop {
            let incoming = incoming(&mut self.follower, &self.gateway.sheets);
            match select3(inbox.fill(), incoming, clock::at(Some(until))).await {
                Either3::First(filled) => return filled.map(|()| true),
                Either3::Second(sheet) => self.deliver(sheet).await?,
                Either3::Third(()) => return Ok(false),
            }
        }
    }

    /// Does some work. What arrives meanwhile is kept, and renews the client's leases; what is heard is delivered.
    async fn during<R: Read, T>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        mut work: Pin<&mut impl Future<Output = T>>,
    ) -> Result<T, End> {
        loop {
            let incoming = incoming(&mut self.follower, &self.gateway.sheets);
            match select3(work.as_mut(), inbox.fill(), incoming).await {
                Either3::First(done) => return Ok(done),
                Either3::Second(filled) => filled?,
                Either3::Third(sheet) => self.deliver(sheet).await?,
            }
        }
    }

    /// Sends the client a frame that was heard for it, or tells it what it has missed.
    async fn deliver(&mut self, mut sheet: Sheet<'_>) -> Result<(), End> {
        match self.follower.read(sheet.bytes()) {
            Some(Ok(length)) => {
                let frame = sheet.bytes().get(..length).unwrap_or_default();
                send(self.writer, frame).await
            }
            Some(Err(lost)) => {
                log::warn!("client {}: {lost} frames came faster than it takes them", self.guest.connection);
                self.tell(self.name, &[], Reason::Lost).await
            }
            None => Ok(()),
        }
    }

    /// Passes on the frame of this length that has begun to arrive.
    async fn pass_on<R: Read>(&mut self, inbox: &mut Inbox<'_, R>, length: usize) -> Result<(), End> {
        let gateway = self.gateway;
        if let (Some(bus), Some(Ok(frame))) = (self.bus, inbox.data().get(..length).map(frame::parse)) {
            // What it stops need not wait for its turn.
            gateway.axes.halt(self.guest.commander(), bus, &frame);
        }
        let mut turn = self.during(inbox, pin!(gateway.desk.turn(self.guest.seat))).await?;
        let (subject, judged) = self.load(inbox, length, &turn).await?;
        let FrameRuling { permits, stop } = match judged {
            Ok(ruling) => ruling,
            Err(reason) => return self.refuse(subject, reason).await,
        };
        turn.send(permits.clone(), stop);
        let outcome = self.during(inbox, pin!(turn.outcome())).await?;
        gateway.axes.frame_ended(&permits, outcome.is_ok());
        self.asked |= outcome.is_ok();
        match outcome {
            Ok(()) => Ok(()),
            Err(undelivered) => self.refuse(subject, reason(undelivered)).await,
        }
    }

    /// Puts the frame into the outgoing place, and judges it.
    async fn load<R: Read>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        length: usize,
        turn: &Turn<'_>,
    ) -> Result<(Subject, Result<FrameRuling, Reason>), End> {
        let mut place = turn.frame().await;
        place.clear();
        loop {
            let part = inbox.data();
            let part = part.get(..length - place.len()).unwrap_or(part);
            let taken = part.len();
            // There is room: no frame is announced that is longer.
            let _ = place.extend_from_slice(part);
            inbox.consume(taken);
            if place.len() == length {
                break;
            }
            let more = !inbox.ended()
                && with_timeout(REST, inbox.fill())
                    .await
                    .map_or(Ok(false), |filled| filled.map(|()| true))?;
            if !more {
                return Ok((Subject::of(&place), Err(Reason::Meaningless)));
            }
        }
        let subject = Subject::of(&place);
        Ok((subject, self.judge(inbox.ended(), &mut place)))
    }

    fn judge(&mut self, gone: bool, bytes: &mut [u8]) -> Result<FrameRuling, Reason> {
        let bus = self.bus.ok_or(Reason::NoLine)?;
        if bytes.get(1) == Some(&NOBODY) {
            frame::set_origin(bytes, self.station).map_err(|_| Reason::Meaningless)?;
        }
        let frame = frame::parse(bytes).map_err(|_| Reason::Meaningless)?;
        self.name = frame.origin;
        self.follower.answer_to(frame.origin);
        let axes = &self.gateway.axes;
        let ruling = axes.judge_frame(self.guest.commander(), bus, &frame).map_err(|_| Reason::Denied)?;
        if self.guest.stop_only && !ruling.stop || gone && !ruling.permits.is_empty() {
            axes.frame_ended(&ruling.permits, false);
            return Err(Reason::Denied);
        }
        Ok(ruling)
    }

    /// Tells the client that its frame was not sent.
    async fn refuse(&mut self, subject: Subject, reason: Reason) -> Result<(), End> {
        let to = if matches!(subject.origin, NOBODY | TRAILER) { self.station } else { subject.origin };
        self.tell(to, &[subject.lrc], reason).await
    }

    /// Sends the client a negative acknowledgement.
    async fn tell(&mut self, to: u8, data: &[u8], reason: Reason) -> Result<(), End> {
        let mut body = Vec::<u8, REFUSAL>::new();
        let mut frame = Vec::<u8, REFUSAL>::new();
        // There is room for it.
        let _ = section::push(&mut body, to, data);
        let kind = Kind::Refusal { reason, session: Session::NONE };
        let _ = frame::emit(&mut frame, self.station, kind, &body);
        send(self.writer, &frame).await
    }
}

/// Waits until something was heard for the client, and for a sheet to put it on.
async fn incoming<'s>(follower: &mut Follower<'_>, sheets: &'s Sheets) -> Sheet<'s> {
    follower.heard().await;
    sheets.lend().await
}

fn reason(undelivered: Undelivered) -> Reason {
    match undelivered {
        Undelivered::Line(Failure::Collisions { .. } | Failure::LineHeld) => Reason::Collisions,
        Undelivered::Line(Failure::NoEcho) => Reason::NoEcho,
        Undelivered::LineDown => Reason::NoLine,
        Undelivered::TooLong => Reason::TooLong,
        Undelivered::Stopped => Reason::Stopped,
    }
}

fn duration(duration: embassy_time::Duration) -> Duration {
    Duration::from_micros(duration.as_micros())
}
