//! Register access to one drive through the desk.

use heapless::Vec;
use puente_drives::edb;
use puente_modbus::reply::Reply;
use puente_modbus::request::Request;
use puente_modbus::{Evidence, Pdu};

use super::AxisError;
use crate::clock;
use crate::desk::{Class, Desk, Failure, Order, Pending, Permit};

/// Words that one reading may have.
const MAX_WORDS: usize = edb::MAX_READ as usize;

/// What a reply that does not fit its request becomes. The master pairs replies exactly, so none comes from the wire.
pub(super) const MISFIT: AxisError = AxisError::Failure(Failure::NoReply(Evidence::Silence));

/// A drive's registers.
pub(super) struct Link<'a> {
    pub(super) desk: &'a Desk,
    pub(super) seat: u8,
    pub(super) bus: u8,
    pub(super) unit: u8,
}

impl<'a> Link<'a> {
    fn submit(&self, class: Class, pdu: Pdu) -> Result<Pending<'a>, AxisError> {
        let order = Order { seat: self.seat, bus: self.bus, unit: self.unit, class, pdu };
        Ok(self.desk.submit(clock::now(), order)?)
    }

    /// Reads `quantity` registers, at most [`MAX_WORDS`], in one request.
    pub(super) async fn read_many(
        &self,
        address: u16,
        quantity: u16,
    ) -> Result<Vec<u16, MAX_WORDS>, AxisError> {
        let request = Request::ReadHoldingRegisters { address, quantity }.emit();
        let reply = self.submit(Class::Free, request.clone())?.await?;
        match Reply::parse(&request, &reply) {
            Ok(Reply::ReadHoldingRegisters { words }) => Ok(words.iter().take(MAX_WORDS).collect()),
            other => Err(refusal(other)),
        }
    }

    /// Reads one register.
    pub(super) async fn read(&self, address: u16) -> Result<u16, AxisError> {
        let words = self.read_many(address, 1).await?;
        words.first().copied().ok_or(MISFIT)
    }

    /// Queues the writing of one register; the result is checked by [`confirm`].
    pub(super) fn start_write(&self, address: u16, value: u16, class: Class) -> Result<Write<'a>, AxisError> {
        let request = Request::WriteSingleRegister { address, value }.emit();
        Ok(Write { pending: self.submit(class, request.clone())?, request })
    }

    /// Writes one register; dropped unsent when the permit is revoked first.
    pub(super) async fn write_guarded(
        &self,
        address: u16,
        value: u16,
        permit: Permit,
    ) -> Result<(), AxisError> {
        self.start_write(address, value, Class::Guarded(permit))?.confirmed().await
    }
}

/// A write on its way.
pub(super) struct Write<'a> {
    pending: Pending<'a>,
    request: Pdu,
}

impl Write<'_> {
    /// Waits for the drive's confirmation.
    pub(super) async fn confirmed(self) -> Result<(), AxisError> {
        let reply = self.pending.await?;
        match Reply::parse(&self.request, &reply) {
            Ok(Reply::WriteSingleRegister { .. }) => Ok(()),
            other => Err(refusal(other)),
        }
    }
}

fn refusal<E>(reply: Result<Reply<'_>, E>) -> AxisError {
    match reply {
        Ok(Reply::Exception { code, .. }) => AxisError::Exception(code),
        _ => MISFIT,
    }
}
