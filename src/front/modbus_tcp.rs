//! Modbus/TCP: pipelined requests, answered as they end.

use core::future::poll_fn;
use core::task::{Context, Poll, ready};

use embassy_futures::select::{Either3, select3};
use embedded_io_async::{Read, Write};
use heapless::Vec;
use puente_line::Duration;
use puente_modbus::mbap::{self, Header, HeaderError};
use puente_modbus::request::Request;
use puente_modbus::{Exception, Pdu};

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
        Failure::NotSent(Reason::Expired | Reason::Resting(_) | Reason::LineDown) | Failure::NoReply(_) => {
            Exception::GatewayTargetFailed
        }
    }
}

/// The flights of one request: one, or one a bus for a broadcast.
pub(super) type Flights<'g> = Vec<Flight<'g>, BUSES>;

/// Judges a request and queues it for its bus, a broadcast for every bus. `gone` tells that its client has closed its
/// side and may not start motion any more.
pub(super) fn route<'g>(
    gateway: &'g Gateway,
    guest: Guest,
    gone: bool,
    unit: u8,
    pdu: &[u8],
) -> Result<Flights<'g>, Exception> {
    let buses = match unit {
        0 => 0..gateway.desk.buses(),
        _ => match gateway.desk.route(unit) {
            Some(bus) => bus..bus + 1,
            None => return Err(Exception::GatewayPathUnavailable),
        },
    };
    let request = Request::parse(pdu)?;
    let owned = Pdu::from_slice(pdu).map_err(|_| Exception::IllegalDataValue)?;
    if unit == 0 && !request.is_write() {
        return Err(Exception::IllegalFunction);
    }
    let mut flights = Vec::new();
    for bus in buses {
        let ruling = gateway.axes.judge(guest.commander(), bus, unit, &request)?;
        if guest.stop_only && ruling.class != Class::Stop || gone && ruling.motion.is_some() {
            gateway.axes.raw_ended(&ruling, false);
            return Err(Exception::ServerDeviceBusy);
        }
        let order = Order { seat: guest.seat, bus, unit, class: ruling.class, pdu: owned.clone() };
        match gateway.desk.submit(clock::now(), order) {
            Ok(pending) => {
                // One flight a bus fits: the vector is as long as there can be buses.
                let function = request.function();
                let _ = flights.push(Flight { broadcast: unit == 0, function, ruling, pending });
            }
            Err(failure) => {
                gateway.axes.raw_ended(&ruling, false);
                return Err(exception(failure));
            }
        }
    }
    Ok(flights)
}

/// A request of this connection, and how its reply is addressed.
struct Transaction<'g> {
    number: u16,
    unit: u8,
    flight: Flight<'g>,
}

/// A reply frame; none is due after a broadcast.
type Reply = Option<Vec<u8, { mbap::MAX_ADU }>>;

pub(super) async fn serve<R: Read, W: Write>(
    gateway: &Gateway,
    guest: Guest,
    inbox: &mut Inbox<'_, R>,
    writer: &mut W,
) -> End {
    let mut open: Vec<Transaction<'_>, FLIGHTS> = Vec::new();
    // Bytes of a frame with a foreign protocol id that are still to be dropped.
    let mut skip = 0;
    loop {
        let reply = match take_frame(gateway, guest, inbox, &mut skip, &mut open) {
            Some(Ok(reply)) => reply,
            Some(Err(end)) => return end,
            None if inbox.ended() && open.is_empty() => return End::Closed,
            None => {
                let patience = Duration::from_micros(idle(gateway).as_micros());
                let quiet = open.is_empty().then(|| clock::now() + patience);
                let any = poll_fn(|context| poll_any(&mut open, context, &gateway.axes));
                match select3(any, inbox.fill(), clock::at(quiet)).await {
                    Either3::First(reply) => reply,
                    Either3::Second(Ok(())) => None,
                    Either3::Second(Err(end)) => return end,
                    Either3::Third(()) => return End::Idle,
                }
            }
        };
        if let Some(reply) = reply
            && let Err(end) = send(writer, &reply).await
        {
            return end;
        }
    }
}

/// The reply of a request that has ended.
fn poll_any<'g>(
    open: &mut Vec<Transaction<'g>, FLIGHTS>,
    context: &mut Context<'_>,
    axes: &Axes,
) -> Poll<Reply> {
    for index in 0..open.len() {
        if let Some(Transaction { number, unit, flight }) = open.get_mut(index) {
            let emit = |pdu: &[u8]| mbap::emit(*number, *unit, pdu);
            if let Poll::Ready(reply) = flight.poll(context, axes, emit) {
                let transaction = open.remove(index);
                return Poll::Ready((!transaction.flight.broadcast).then_some(reply));
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
) -> Option<Result<Reply, End>> {
    let dropped = (*skip).min(inbox.data().len());
    inbox.consume(dropped);
    *skip -= dropped;
    let bytes = inbox.data().first_chunk::<{ mbap::HEADER }>()?;
    let Header { transaction: number, unit, pdu_len } = match Header::parse(bytes) {
        Ok(header) => header,
        Err(HeaderError::Protocol { length, .. }) => {
            // The length counts from the unit id on, the last byte of the header.
            *skip = mbap::HEADER - 1 + usize::from(length);
            return Some(Ok(None));
        }
        Err(HeaderError::Length { .. }) => return Some(Err(End::Refused)),
    };
    let length = mbap::HEADER + usize::from(pdu_len);
    let pdu = inbox.data().get(mbap::HEADER..length)?;
    let function = pdu.first().copied().unwrap_or_default();
    let refusal = match route(gateway, guest, inbox.ended(), unit, pdu) {
        Err(exception) => Some(exception),
        // The desk takes no more of one client than fit here, except stops.
        Ok(flights) => flights.into_iter().find_map(|flight| {
            let queued = open.push(Transaction { number, unit, flight });
            queued.err().map(|_| Exception::ServerDeviceBusy)
        }),
    };
    inbox.consume(length);
    Some(Ok(refusal.map(|exception| mbap::emit(number, unit, &exception.pdu(function)))))
}
