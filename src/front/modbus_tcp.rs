//! Modbus/TCP: pipelined requests, answered as they end.

use core::future::poll_fn;
use core::pin::Pin;
use core::task::{Context, Poll};

use embassy_futures::select::{Either3, select3};
use embassy_time::Timer;
use embedded_io_async::{Read, Write};
use heapless::Vec;
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
    ruling: Ruling,
    pending: Pending<'g>,
}

impl Flight<'_> {
    fn poll(&mut self, context: &mut Context<'_>, axes: &Axes) -> Poll<Result<Pdu, Exception>> {
        let Poll::Ready(answer) = Future::poll(Pin::new(&mut self.pending), context) else {
            return Poll::Pending;
        };
        axes.raw_ended(&self.ruling, !matches!(answer, Err(Failure::NotSent(_))));
        Poll::Ready(answer.map_err(exception))
    }

    /// Waits for the reply PDU, or for the exception that stands for its absence.
    pub(super) async fn ended(mut self, axes: &Axes) -> Result<Pdu, Exception> {
        poll_fn(|context| self.poll(context, axes)).await
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
                let _ = flights.push(Flight { broadcast: unit == 0, ruling, pending });
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
    function: u8,
    flight: Flight<'g>,
}

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
        while let Some(frame) = next_frame(inbox, &mut skip) {
            let Ok((header, pdu)) = frame else {
                return End::Refused;
            };
            let function = pdu.first().copied().unwrap_or_default();
            let refusal = match route(gateway, guest, inbox.ended(), header.unit, &pdu) {
                Err(exception) => Some(exception),
                Ok(flights) => flights.into_iter().find_map(|flight| {
                    let (number, unit) = (header.transaction, header.unit);
                    // The desk takes no more of one client than fit here, except stops.
                    open.push(Transaction { number, unit, function, flight })
                        .err()
                        .map(|_| Exception::ServerDeviceBusy)
                }),
            };
            if let Some(exception) = refusal {
                let reply = mbap::emit(header.transaction, header.unit, &exception.pdu(function));
                if let Err(end) = send(writer, &reply).await {
                    return end;
                }
            }
        }
        if inbox.ended() && open.is_empty() {
            return End::Closed;
        }
        let quiet = open.is_empty();
        let silence =
            async { if quiet { Timer::after(idle(gateway)).await } else { core::future::pending().await } };
        match select3(poll_fn(|context| poll_any(&mut open, context, &gateway.axes)), inbox.fill(), silence)
            .await
        {
            Either3::First((transaction, result)) => {
                let pdu = match result {
                    _ if transaction.flight.broadcast => continue,
                    Ok(pdu) => pdu,
                    Err(exception) => Pdu::from_iter(exception.pdu(transaction.function)),
                };
                if let Err(end) = send(writer, &mbap::emit(transaction.number, transaction.unit, &pdu)).await
                {
                    return end;
                }
            }
            Either3::Second(Ok(())) => {}
            Either3::Second(Err(end)) => return end,
            Either3::Third(()) => return End::Idle,
        }
    }
}

type Ended<'g> = (Transaction<'g>, Result<Pdu, Exception>);

fn poll_any<'g>(
    open: &mut Vec<Transaction<'g>, FLIGHTS>,
    context: &mut Context<'_>,
    axes: &Axes,
) -> Poll<Ended<'g>> {
    for index in 0..open.len() {
        if let Some(transaction) = open.get_mut(index)
            && let Poll::Ready(result) = transaction.flight.poll(context, axes)
        {
            return Poll::Ready((open.remove(index), result));
        }
    }
    Poll::Pending
}

/// The next whole frame. Frames of another protocol are dropped; a length that cannot be ends the connection, for
/// nobody knows where the next frame begins.
fn next_frame<R: Read>(inbox: &mut Inbox<'_, R>, skip: &mut usize) -> Option<Result<(Header, Pdu), End>> {
    loop {
        let dropped = (*skip).min(inbox.data().len());
        inbox.consume(dropped);
        *skip -= dropped;
        let bytes = inbox.data().first_chunk::<{ mbap::HEADER }>()?;
        match Header::parse(bytes) {
            Ok(header) => {
                let length = mbap::HEADER + usize::from(header.pdu_len);
                let pdu = Pdu::from_slice(inbox.data().get(mbap::HEADER..length)?);
                inbox.consume(length);
                return Some(pdu.map(|pdu| (header, pdu)).map_err(|_| End::Refused));
            }
            Err(HeaderError::Protocol { length, .. }) => {
                // The length counts from the unit id on, the last byte of the header.
                *skip = mbap::HEADER - 1 + usize::from(length);
            }
            Err(HeaderError::Length { .. }) => return Some(Err(End::Refused)),
        }
    }
}
