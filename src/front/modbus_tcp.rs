//! Modbus/TCP: pipelined requests, answered as they end.

use core::future::poll_fn;
use core::task::{Context, Poll, ready};

use embassy_futures::select::{Either3, select3};
use embedded_io_async::{Read, Write};
use heapless::Vec;
use puente_line::Duration;
use puente_modbus::mbap::{self, Header, HeaderError};
use puente_modbus::request::Request;
use puente_modbus::{Exception, MAX_PDU};

use super::inbox::Inbox;
use super::{End, Gateway, Guest, idle, send};
use crate::axis::{Axes, Ruling};
use crate::clock;
use crate::desk::{Class, Failure, Order, Pending, Reason};
use crate::port::limits::{BUSES, PIPELINE};

/// Room for one pipeline, and for a stop on every bus beyond it.
const FLIGHTS: usize = PIPELINE + BUSES;

/// A request on its way to a bus.
pub(super) struct Flight<'g> {
    /// No reply is due.
    pub(super) broadcast: bool,
    function: u8,
    ruling: Ruling,
    pending: Pending<'g>,
}

impl Flight<'_> {
    /// What `f` makes of the reply PDU, or of the exception that stands for its absence.
    pub(super) fn poll<T>(
        &mut self,
        context: &mut Context<'_>,
        axes: &Axes,
        f: impl FnOnce(&[u8]) -> T,
    ) -> Poll<T> {
        let (ruling, function) = (&self.ruling, self.function);
        let (sent, result) = ready!(self.pending.poll_answer(context, |answer| {
            let sent = !matches!(answer, Err(Failure::NotSent(_)));
            let result = match answer {
                Ok(pdu) => f(pdu),
                Err(failure) => f(&exception(failure).pdu(function)),
            };
            (sent, result)
        }));
        axes.raw_ended(ruling, sent);
        Poll::Ready(result)
    }
}

/// 06 tells a client to come again; 0A and 0B tell of the path, as gateways do.
fn exception(failure: Failure) -> Exception {
    match failure {
        Failure::NotSent(Reason::Unmapped) => Exception::GatewayPathUnavailable,
        Failure::NotSent(Reason::QueueFull | Reason::Stopped) => Exception::ServerDeviceBusy,
        Failure::NotSent(Reason::Expired | Reason::Resting(_) | Reason::LineDown | Reason::Line(_))
        | Failure::NoReply(_) => Exception::GatewayTargetFailed,
    }
}

/// The flights of one request: one, or one a bus for a broadcast.
pub(super) type Flights<'g> = Vec<Flight<'g>, BUSES>;

/// Judges a request and queues it for its bus, a broadcast for every bus. `take` gets each flight, and says false where it
/// has no room. After a refusal the flights of this request are to be dropped. `gone` tells that the client has closed its
/// side and may not start motion any more.
pub(super) fn route<'g>(
    gateway: &'g Gateway,
    guest: Guest,
    gone: bool,
    unit: u8,
    pdu: &[u8],
    mut take: impl FnMut(Flight<'g>) -> bool,
) -> Result<(), Exception> {
    let buses: Vec<u8, BUSES> = match unit {
        0 => gateway.desk.unit_buses(),
        _ => gateway.desk.route(unit).into_iter().collect(),
    };
    if buses.is_empty() {
        return Err(Exception::GatewayPathUnavailable);
    }
    if pdu.len() > MAX_PDU {
        return Err(Exception::IllegalDataValue);
    }
    let request = Request::parse(pdu)?;
    if unit == 0 && !request.is_write() {
        return Err(Exception::IllegalFunction);
    }
    for bus in buses {
        let ruling = gateway.axes.judge(guest.commander(), bus, unit, &request)?;
        if guest.stop_only && ruling.class != Class::Stop || gone && ruling.motion.is_some() {
            gateway.axes.raw_ended(&ruling, false);
            return Err(Exception::ServerDeviceBusy);
        }
        let order = Order { seat: guest.seat, bus, unit, class: ruling.class, pdu };
        match gateway.desk.submit(clock::now(), order) {
            Ok(pending) => {
                let function = request.function();
                if !take(Flight { broadcast: unit == 0, function, ruling, pending }) {
                    return Err(Exception::ServerDeviceBusy);
                }
            }
            Err(failure) => {
                gateway.axes.raw_ended(&ruling, false);
                return Err(exception(failure));
            }
        }
    }
    Ok(())
}

/// A request of this connection, and how its reply is addressed.
struct Transaction<'g> {
    number: u16,
    unit: u8,
    flight: Flight<'g>,
}

/// A reply frame; empty where none is due.
type Reply = Vec<u8, { mbap::MAX_ADU }>;

pub(super) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    let mut open: Vec<Transaction<'_>, FLIGHTS> = Vec::new();
    // Bytes of a frame with a foreign protocol id that are still to be dropped.
    let mut skip = 0;
    let mut reply = Reply::new();
    loop {
        match take_frame(gateway, guest, inbox, &mut skip, &mut open, &mut reply) {
            Some(Ok(())) => {}
            Some(Err(end)) => return end,
            None if inbox.ended() && open.is_empty() => return End::Closed,
            None => {
                let patience = Duration::from_micros(idle(gateway).as_micros());
                let quiet = open.is_empty().then(|| clock::now() + patience);
                let any = poll_fn(|context| poll_any(&mut open, context, &gateway.axes, &mut reply));
                match select3(any, inbox.fill(), clock::at(quiet)).await {
                    Either3::First(()) | Either3::Second(Ok(())) => {}
                    Either3::Second(Err(end)) => return end,
                    Either3::Third(()) => return End::Idle,
                }
            }
        }
        if !reply.is_empty()
            && let Err(end) = send(writer, &reply).await
        {
            return end;
        }
        reply.clear();
    }
}

/// Ready when a request has ended; writes its reply, but none to a broadcast.
fn poll_any<'g>(
    open: &mut Vec<Transaction<'g>, FLIGHTS>,
    context: &mut Context<'_>,
    axes: &Axes,
    reply: &mut Reply,
) -> Poll<()> {
    for index in 0..open.len() {
        if let Some(Transaction { number, unit, flight }) = open.get_mut(index) {
            let broadcast = flight.broadcast;
            let write = |pdu: &[u8]| {
                if !broadcast {
                    mbap::write(reply, *number, *unit, pdu);
                }
            };
            if flight.poll(context, axes, write).is_ready() {
                open.remove(index);
                return Poll::Ready(());
            }
        }
    }
    Poll::Pending
}

/// Takes the next whole frame, if there is one, and queues its request; a refusal is replied to at once. Frames of
/// another protocol are dropped. A length that cannot be ends the connection, for nobody knows where the next frame
/// begins.
fn take_frame<'g, R: Read>(
    gateway: &'g Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    skip: &mut usize,
    open: &mut Vec<Transaction<'g>, FLIGHTS>,
    reply: &mut Reply,
) -> Option<Result<(), End>> {
    let dropped = (*skip).min(inbox.data().len());
    inbox.consume(dropped);
    *skip -= dropped;
    let bytes = inbox.data().first_chunk::<{ mbap::HEADER }>()?;
    let Header { transaction: number, unit, pdu_len } = match Header::parse(bytes) {
        Ok(header) => header,
        Err(HeaderError::Protocol { length, .. }) => {
            // The length counts from the unit id on, the last byte of the header.
            *skip = mbap::HEADER - 1 + usize::from(length);
            return Some(Ok(()));
        }
        Err(HeaderError::Length { .. }) => return Some(Err(End::Refused)),
    };
    let length = mbap::HEADER + usize::from(pdu_len);
    let pdu = inbox.data().get(mbap::HEADER..length)?;
    let function = pdu.first().copied().unwrap_or_default();
    let before = open.len();
    // The desk takes no more of one client than fit here, except stops.
    let take = |flight| open.push(Transaction { number, unit, flight }).is_ok();
    let routed = route(gateway, guest, inbox.ended(), unit, pdu, take);
    inbox.consume(length);
    if let Err(exception) = routed {
        open.truncate(before);
        mbap::write(reply, number, unit, &exception.pdu(function));
    }
    Some(Ok(()))
}
