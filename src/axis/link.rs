//! Register access to one drive through the desk.

use heapless::Vec;
use puente_drives::edb;
use puente_modbus::Evidence;
use puente_modbus::request::Request;

use super::AxisError;
use crate::clock;
use crate::desk::{Class, Desk, Failure, Order, Pending};

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
    fn submit(&self, class: Class, request: &Request<'_>) -> Result<Pending<'a>, AxisError> {
        let order = Order { seat: self.seat, bus: self.bus, unit: self.unit, class, pdu: &request.emit() };
        Ok(self.desk.submit(clock::now(), order)?)
    }

    /// Reads `quantity` registers, at most [`MAX_WORDS`], in one request.
    pub(super) async fn read_many(
        &self,
        address: u16,
        quantity: u16,
        class: Class,
    ) -> Result<Vec<u16, MAX_WORDS>, AxisError> {
        let mut pending = self.submit(class, &Request::ReadHoldingRegisters { address, quantity })?;
        let words = |data: &[u8]| {
            // Behind function code and byte count.
            let (words, _) = data.get(2..).unwrap_or_default().as_chunks();
            words.iter().take(MAX_WORDS).map(|word| u16::from_be_bytes(*word)).collect()
        };
        pending.answer(|reply| normal(reply).map(words)).await
    }

    /// Reads one register.
    pub(super) async fn read(&self, address: u16, class: Class) -> Result<u16, AxisError> {
        let words = self.read_many(address, 1, class).await?;
        words.first().copied().ok_or(MISFIT)
    }

    /// Queues the writing of one register.
    pub(super) fn start_write(&self, address: u16, value: u16, class: Class) -> Result<Write<'a>, AxisError> {
        Ok(Write(self.submit(class, &Request::WriteSingleRegister { address, value })?))
    }

    /// Writes one register.
    pub(super) async fn write(&self, address: u16, value: u16, class: Class) -> Result<(), AxisError> {
        self.start_write(address, value, class)?.confirmed().await
    }
}

/// A write on its way.
pub(super) struct Write<'a>(Pending<'a>);

impl Write<'_> {
    /// Waits for the drive's confirmation.
    pub(super) async fn confirmed(mut self) -> Result<(), AxisError> {
        self.0.answer(|reply| normal(reply).map(|_| ())).await
    }
}

/// The PDU of a normal reply, which the master has paired with its request to the last field.
fn normal(reply: Result<&[u8], Failure>) -> Result<&[u8], AxisError> {
    match reply? {
        [function, code, ..] if function & 0x80 != 0 => Err(AxisError::Exception(*code)),
        pdu => Ok(pdu),
    }
}
