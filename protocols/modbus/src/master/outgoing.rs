//! A request on its way, and what is a reply to it.

use crate::reply::{Mismatch, Reply};
use crate::request::{ReplyLength, Request};
use crate::{Exception, Frame, Mode, Pdu, ascii, rtu};

use super::Evidence;

/// The request in work, or the last one.
#[derive(Clone, Debug)]
pub(super) struct Outgoing {
    pub unit: u8,
    pub pdu: Pdu,
    pub adu: heapless::Vec<u8, { ascii::MAX_ADU }>,
    /// Characters of the normal reply; 0 where the request does not tell.
    pub reply_adu: usize,
}

impl Outgoing {
    /// Before the first request.
    pub const fn none() -> Self {
        Self { unit: 0, pdu: Pdu::new(), adu: heapless::Vec::new(), reply_adu: 0 }
    }

    /// Becomes this request.
    ///
    /// # Errors
    /// What a server answers to a malformed request; it is nothing then.
    pub fn set(&mut self, mode: Mode, unit: u8, pdu: &[u8]) -> Result<(), Exception> {
        self.pdu.clear();
        self.adu.clear();
        self.reply_adu = match (Request::parse(pdu)?.expected(), mode) {
            (ReplyLength::Exact(pdu), Mode::Rtu) => pdu + rtu::OVERHEAD,
            (ReplyLength::Exact(pdu), Mode::Ascii) => 2 * pdu + ascii::OVERHEAD,
            _ => 0,
        };
        self.unit = unit;
        self.pdu.extend_from_slice(pdu).map_err(|_| Exception::IllegalDataValue)?;
        match mode {
            Mode::Rtu => rtu::write(&mut self.adu, unit, pdu),
            Mode::Ascii => ascii::write(&mut self.adu, unit, pdu),
        }
        Ok(())
    }

    /// Whether `frame` is the reply to this request; else why it is not.
    pub fn pair(&self, frame: &Frame) -> Result<(), Evidence> {
        if frame.unit != self.unit {
            return Err(Evidence::WrongUnit { expected: self.unit, received: frame.unit });
        }
        match Reply::parse(&self.pdu, &frame.pdu) {
            Ok(_) => Ok(()),
            Err(_) if frame.pdu == self.pdu => Err(Evidence::Echo),
            Err(Mismatch::Function { expected, received }) => {
                Err(Evidence::WrongFunction { expected, received })
            }
            Err(Mismatch::Length { expected, received }) => Err(Evidence::WrongLength { expected, received }),
            Err(Mismatch::Field { expected, received }) => Err(Evidence::WrongField { expected, received }),
            Err(Mismatch::Request(exception)) => Err(Evidence::Malformed(exception)),
        }
    }
}
