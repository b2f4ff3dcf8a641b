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

    /// # Errors
    /// What a server answers to a malformed request.
    pub fn new(mode: Mode, unit: u8, pdu: &[u8]) -> Result<Self, Exception> {
        let reply_adu = match (Request::parse(pdu)?.expected(), mode) {
            (ReplyLength::Exact(pdu), Mode::Rtu) => pdu + rtu::OVERHEAD,
            (ReplyLength::Exact(pdu), Mode::Ascii) => 2 * pdu + ascii::OVERHEAD,
            _ => 0,
        };
        let pdu = Pdu::from_slice(pdu).map_err(|_| Exception::IllegalDataValue)?;
        let mut adu = heapless::Vec::new();
        // Neither framing is longer than the vector.
        let _ = match mode {
            Mode::Rtu => adu.extend_from_slice(&rtu::emit(unit, &pdu)),
            Mode::Ascii => adu.extend_from_slice(&ascii::emit(unit, &pdu)),
        };
        Ok(Self { unit, pdu, adu, reply_adu })
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
