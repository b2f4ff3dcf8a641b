//! The commands of CiA 309-3 that take their time.

use core::fmt::Write as _;
use core::pin::pin;

use embassy_time::with_timeout;
use embedded_io_async::{Read, Write};
use heapless::Vec;
use puente_canopen::sdo::Abort;
use puente_canopen::{Address, NodeId, nmt};
use puente_cia309::indication::What;
use puente_cia309::reply::Answer;
use puente_cia309::value::{DataType, Decoder, Encoder};
use puente_cia309::{Error, Indication, Reply as Response};
use puente_line::Duration;

use super::super::inbox::Inbox;
use super::super::{End, idle, send};
use super::raw::Unsent;
use super::{Client, say};
use crate::clock;
use crate::desk::{CanFailure, Class, Reason, SdoOrder, SdoTransfer};
use crate::port::limits::SDO_DATA;

/// Bytes of an object that are taken at once.
const PIECE: usize = 64;
/// Room for their text, and for what stands before and behind it.
const TEXT: usize = Encoder::room(PIECE) + Encoder::room(0) + 16;

/// An object, and the sequence number of the command that is about it.
#[derive(Clone, Copy)]
pub(super) struct Object {
    pub bus: u8,
    pub sequence: u32,
    pub node: NodeId,
    pub address: Address,
    pub kind: DataType,
}

impl Client<'_> {
    fn order<'d>(&self, object: Object, transfer: SdoTransfer<'d>) -> SdoOrder<'d> {
        SdoOrder {
            seat: self.guest.seat,
            bus: object.bus,
            node: object.node,
            class: Class::Free,
            transfer,
            timeout: self.session.sdo_timeout.map(|ms| Duration::from_millis(ms.into())),
        }
    }

    /// Reads an object, of any length: it is told as it comes.
    pub(super) async fn read<R: Read, W: Write>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
        object: Object,
    ) -> Result<(), End> {
        let transfer = SdoTransfer::Read { address: object.address, block: self.session.sdo_block };
        let mut pending = match self.gateway.desk.sdo(clock::now(), self.order(object, transfer)) {
            Ok(pending) => pending,
            Err(failure) => return say(writer, object.sequence, answer(failure)).await,
        };
        let mut encoder = Encoder::new(object.kind);
        let mut text = Vec::<u8, TEXT>::new();
        let _ = write!(text, "{}", Response::head(object.sequence));
        let mut begun = false;
        loop {
            let mut piece = [0; PIECE];
            let read = Self::during(inbox, pin!(pending.read(&mut piece))).await?;
            match read {
                Ok(0) => break,
                Ok(count) => {
                    let bytes = piece.get(..count).unwrap_or_default();
                    // There is room for it: what is there is sent before it could be otherwise.
                    encoder.push(bytes, &mut |byte| {
                        let _ = text.push(byte);
                    });
                }
                Err(failure) if begun => {
                    let mut end = heapless::String::<128>::new();
                    let _ = write!(end, "{}", Response::broken_off(abort(failure)));
                    return send(writer, end.as_bytes()).await;
                }
                Err(failure) => return say(writer, object.sequence, answer(failure)).await,
            }
            if TEXT - text.len() < Encoder::room(PIECE) + Encoder::room(0) {
                send(writer, &text).await?;
                text.clear();
                begun = true;
            }
        }
        encoder.end(&mut |byte| {
            let _ = text.push(byte);
        });
        let _ = text.extend_from_slice(b"\r\n");
        send(writer, &text).await
    }

    /// Writes an object. Its value is what comes next, to the end of the line.
    pub(super) async fn write<R: Read, W: Write>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
        object: Object,
    ) -> Result<(), End> {
        let mut data = Vec::<u8, SDO_DATA>::new();
        let value = self.value(inbox, object.kind, &mut data).await?;
        if let Err(error) = value {
            return say(writer, object.sequence, Answer::Error(error)).await;
        }
        let by = self.guest.commander();
        let ruling = self.gateway.axes.judge_sdo(by, object.bus, object.node, object.address, &data);
        let ruling = match ruling {
            Ok(ruling) if inbox.ended() && ruling.motion.is_some() => {
                self.gateway.axes.raw_ended(&ruling, false);
                return say(writer, object.sequence, Answer::Error(Error::State)).await;
            }
            Ok(ruling) => ruling,
            Err(_) => return say(writer, object.sequence, Answer::Error(Error::State)).await,
        };
        let transfer =
            SdoTransfer::Write { address: object.address, data: &data, block: self.session.sdo_block };
        let order = SdoOrder { class: ruling.class, ..self.order(object, transfer) };
        let written = match self.gateway.desk.sdo(clock::now(), order) {
            Ok(mut pending) => Self::during(inbox, pin!(pending.written())).await?,
            Err(failure) => Err(failure),
        };
        self.gateway.axes.raw_ended(&ruling, !matches!(written, Err(CanFailure::NotSent(_))));
        let answer = written.map_or_else(answer, |()| Answer::Ok);
        say(writer, object.sequence, answer).await
    }

    /// Takes a value from the client, as it comes.
    async fn value<R: Read>(
        &self,
        inbox: &mut Inbox<'_, R>,
        kind: DataType,
        data: &mut Vec<u8, SDO_DATA>,
    ) -> Result<Result<(), Error>, End> {
        let mut decoder = Decoder::new(kind);
        let mut value = Ok(());
        loop {
            let there = inbox.data();
            let end = there.iter().position(|byte| *byte == b'\n');
            let part = there.get(..end.unwrap_or(there.len())).unwrap_or(there);
            let mut full = false;
            let mut take = |byte| full |= data.push(byte).is_err();
            for byte in part {
                if value.is_ok() && decoder.push(*byte, &mut take).is_err() {
                    value = Err(Error::Syntax);
                }
            }
            let whole = end.is_some() || inbox.ended();
            if whole && value.is_ok() && decoder.clone().end(&mut take).is_err() {
                value = Err(Error::Syntax);
            }
            if full && value.is_ok() {
                value = Err(Error::Memory);
            }
            let read = part.len() + usize::from(end.is_some());
            inbox.consume(read);
            if whole {
                return Ok(value);
            }
            with_timeout(idle(self.gateway), inbox.fill()).await.unwrap_or(Err(End::Idle))?;
        }
    }

    /// Commands a node, or all.
    pub(super) fn nmt(&self, gone: bool, bus: u8, command: nmt::Command, node: Option<NodeId>) -> Answer {
        match self.gateway.command_node(self.guest, gone, bus, command, node) {
            Ok(()) => Answer::Ok,
            Err(why) => Answer::Error(unsent(why)),
        }
    }

    /// Tells the emergencies that were heard, the latest last.
    pub(super) async fn log<W: Write>(&self, writer: &mut W, bus: u8) -> Result<(), End> {
        let Some((_, net)) = self.gateway.can_buses().find(|(other, _)| *other == bus) else {
            return send(writer, b"\r\n").await;
        };
        for node in NodeId::all() {
            for (_, emergency) in self.gateway.desk.emergencies(bus, node) {
                let mut line = heapless::String::<64>::new();
                let _ = write!(line, "{}", Indication { net, what: What::Emergency(node, emergency) });
                send(writer, line.as_bytes()).await?;
            }
        }
        send(writer, b"\r\n").await
    }
}

/// What a client is answered when an object was not read or written, or a command not sent.
fn answer(failure: CanFailure) -> Answer {
    match failure {
        CanFailure::Sdo(failure) => Answer::Abort(failure.code()),
        CanFailure::NotSent(reason) => Answer::Error(unsent(Unsent::NotSent(reason))),
        CanFailure::TooLong => Answer::Error(Error::Memory),
    }
}

/// The same of a value of which part has been told already.
fn abort(failure: CanFailure) -> Abort {
    match failure {
        CanFailure::Sdo(failure) => failure.code(),
        CanFailure::NotSent(_) | CanFailure::TooLong => Abort::LOCAL_CONTROL,
    }
}

/// The number of a reason not to send something.
pub(super) const fn unsent(why: Unsent) -> Error {
    match why {
        Unsent::NotSent(Reason::Unmapped) => Error::Net,
        Unsent::NotSent(Reason::QueueFull) => Error::Memory,
        Unsent::NotSent(Reason::Expired) => Error::TimeOut,
        Unsent::NotSent(Reason::LineDown) => Error::BusOff,
        Unsent::NotSent(Reason::Resting(_) | Reason::Stopped | Reason::Line(_))
        | Unsent::Full
        | Unsent::Gone
        | Unsent::Refused(_) => Error::State,
    }
}
