//! Reply PDUs, and which reply belongs to which request (V1.1b3, clauses 6 and 7).

use core::fmt;

use crate::function as fc;
use crate::length::{self, Length};
use crate::request::{ReplyLength, Request, coil, word};
use crate::{Exception, Pdu, Words, join};

/// A reply, over the bytes of its PDU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reply<'a> {
    /// 01 Read Coils.
    ReadCoils {
        /// Eight coils a byte, the first in the lowest bit.
        bits: &'a [u8],
    },
    /// 02 Read Discrete Inputs.
    ReadDiscreteInputs {
        /// Eight inputs a byte, the first in the lowest bit.
        bits: &'a [u8],
    },
    /// 03 Read Holding Registers.
    ReadHoldingRegisters {
        /// The values.
        words: Words<'a>,
    },
    /// 04 Read Input Registers.
    ReadInputRegisters {
        /// The values.
        words: Words<'a>,
    },
    /// 05 Write Single Coil: the request again.
    WriteSingleCoil {
        /// The coil.
        address: u16,
        /// Its state.
        on: bool,
    },
    /// 06 Write Single Register: the request again.
    WriteSingleRegister {
        /// The register.
        address: u16,
        /// Its value.
        value: u16,
    },
    /// 08 Diagnostics.
    Diagnostics {
        /// What was diagnosed.
        sub_function: u16,
        /// Data of the sub-function.
        data: &'a [u8],
    },
    /// 0F Write Multiple Coils.
    WriteMultipleCoils {
        /// First coil.
        address: u16,
        /// Coils written.
        quantity: u16,
    },
    /// 10 Write Multiple Registers.
    WriteMultipleRegisters {
        /// First register.
        address: u16,
        /// Registers written.
        quantity: u16,
    },
    /// 11 Report Server ID.
    ReportServerId {
        /// Identifier, run indicator (00 or FFh) and more, as the maker likes.
        data: &'a [u8],
    },
    /// 16 Mask Write Register: the request again.
    MaskWriteRegister {
        /// The register.
        address: u16,
        /// Bits kept.
        and_mask: u16,
        /// Bits set where not kept.
        or_mask: u16,
    },
    /// 17 Read/Write Multiple Registers.
    ReadWriteMultipleRegisters {
        /// The values read.
        words: Words<'a>,
    },
    /// 2B/0E Read Device Identification.
    ReadDeviceIdentification {
        /// Category, as asked.
        code: u8,
        /// What the device supports: 01-03h, 81-83h with single access.
        conformity: u8,
        /// FFh if more objects follow in another reply, else 00.
        more: u8,
        /// The object to ask for next.
        next: u8,
        /// Number of objects here.
        count: u8,
        /// The objects: identifier, length, text, one after the other. See [`objects`].
        objects: &'a [u8],
    },
    /// The request was not carried out.
    Exception {
        /// Function code of the request.
        function: u8,
        /// Exception code; vendors have their own, so see [`Exception::from_code`].
        code: u8,
    },
    /// Any other function.
    Other {
        /// Function code, 1 to 7Fh.
        function: u8,
        /// All that follows it.
        data: &'a [u8],
    },
}

/// Why a PDU is no reply to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mismatch {
    /// Another function.
    Function {
        /// Of the request.
        expected: u8,
        /// Of the PDU.
        received: u8,
    },
    /// Another length or byte count than the request or the PDU itself calls for.
    Length {
        /// PDU bytes called for.
        expected: u16,
        /// PDU bytes, or those that its byte count stands for.
        received: u16,
    },
    /// A field that repeats the request's differs.
    Field {
        /// In the request.
        expected: u16,
        /// In the PDU.
        received: u16,
    },
    /// The request itself is malformed, so that nothing can be its reply.
    Request(Exception),
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Function { expected, received } => {
                write!(f, "function {received:02X}h came instead of {expected:02X}h")
            }
            Self::Length { expected, received } => {
                write!(f, "a PDU of {received} bytes came instead of {expected}")
            }
            Self::Field { expected, received } => {
                write!(f, "{received:04X}h was repeated instead of {expected:04X}h")
            }
            Self::Request(exception) => write!(f, "the request is malformed: {exception}"),
        }
    }
}

impl core::error::Error for Mismatch {}

impl<'a> Reply<'a> {
    /// Reads `reply`, if it is one to `request`: same function or its exception, the length and byte count that the
    /// request calls for, the fields that a reply repeats.
    ///
    /// # Errors
    /// The first mismatch, in the order function, length, repeated field.
    pub fn parse(request: &[u8], reply: &'a [u8]) -> Result<Self, Mismatch> {
        let asked = Request::parse(request).map_err(Mismatch::Request)?;
        let Some((&received, data)) = reply.split_first() else {
            return Err(wrong_length(2, 0));
        };
        let function = asked.function();
        if received == function | fc::EXCEPTION {
            return match *data {
                [code] => Ok(Self::Exception { function, code }),
                _ => Err(wrong_length(2, reply.len())),
            };
        }
        if received != function {
            return Err(Mismatch::Function { expected: function, received });
        }
        match asked.expected() {
            ReplyLength::Exact(length) if length != reply.len() => {
                return Err(wrong_length(length, reply.len()));
            }
            ReplyLength::Never => return Err(wrong_length(2, reply.len())),
            _ => {}
        }
        match asked {
            Request::ReadCoils { .. } => Ok(Self::ReadCoils { bits: counted(data)? }),
            Request::ReadDiscreteInputs { .. } => Ok(Self::ReadDiscreteInputs { bits: counted(data)? }),
            Request::ReadHoldingRegisters { .. } => {
                Ok(Self::ReadHoldingRegisters { words: Words::from_bytes(counted(data)?) })
            }
            Request::ReadInputRegisters { .. } => {
                Ok(Self::ReadInputRegisters { words: Words::from_bytes(counted(data)?) })
            }
            Request::ReadWriteMultipleRegisters { .. } => {
                Ok(Self::ReadWriteMultipleRegisters { words: Words::from_bytes(counted(data)?) })
            }
            Request::WriteSingleCoil { address, on } => {
                repeated(request, data)?;
                Ok(Self::WriteSingleCoil { address, on })
            }
            Request::WriteSingleRegister { address, value } => {
                repeated(request, data)?;
                Ok(Self::WriteSingleRegister { address, value })
            }
            Request::WriteMultipleCoils { address, quantity, .. } => {
                repeated(request, data)?;
                Ok(Self::WriteMultipleCoils { address, quantity })
            }
            Request::WriteMultipleRegisters { address, words } => {
                repeated(request, data)?;
                Ok(Self::WriteMultipleRegisters { address, quantity: words.len() as u16 })
            }
            Request::MaskWriteRegister { address, and_mask, or_mask } => {
                repeated(request, data)?;
                Ok(Self::MaskWriteRegister { address, and_mask, or_mask })
            }
            Request::Diagnostics { sub_function, .. } => {
                // Return Query Data (00) repeats everything, the others their sub-function.
                repeated(request, if sub_function == 0 { data } else { data.get(..2).unwrap_or(data) })?;
                Ok(Self::Diagnostics { sub_function, data: data.get(2..).unwrap_or(&[]) })
            }
            Request::ReportServerId => Ok(Self::ReportServerId { data: counted(data)? }),
            Request::ReadDeviceIdentification { code, object } => identification(reply, code, object),
            Request::Other { .. } => Ok(Self::Other { function, data }),
        }
    }

    /// The PDU; empty where it would not fit one.
    pub fn emit(&self) -> Pdu {
        match *self {
            Self::ReadCoils { bits } => join(&[&[fc::READ_COILS, bits.len() as u8], bits]),
            Self::ReadDiscreteInputs { bits } => join(&[&[fc::READ_DISCRETE_INPUTS, bits.len() as u8], bits]),
            Self::ReadHoldingRegisters { words } => emit_words(fc::READ_HOLDING_REGISTERS, words),
            Self::ReadInputRegisters { words } => emit_words(fc::READ_INPUT_REGISTERS, words),
            Self::ReadWriteMultipleRegisters { words } => {
                emit_words(fc::READ_WRITE_MULTIPLE_REGISTERS, words)
            }
            Self::WriteSingleCoil { address, on } => {
                join(&[&[fc::WRITE_SINGLE_COIL], &address.to_be_bytes(), &coil(on)])
            }
            Self::WriteSingleRegister { address, value } => {
                join(&[&[fc::WRITE_SINGLE_REGISTER], &address.to_be_bytes(), &value.to_be_bytes()])
            }
            Self::Diagnostics { sub_function, data } => {
                join(&[&[fc::DIAGNOSTICS], &sub_function.to_be_bytes(), data])
            }
            Self::WriteMultipleCoils { address, quantity } => {
                join(&[&[fc::WRITE_MULTIPLE_COILS], &address.to_be_bytes(), &quantity.to_be_bytes()])
            }
            Self::WriteMultipleRegisters { address, quantity } => {
                join(&[&[fc::WRITE_MULTIPLE_REGISTERS], &address.to_be_bytes(), &quantity.to_be_bytes()])
            }
            Self::ReportServerId { data } => join(&[&[fc::REPORT_SERVER_ID, data.len() as u8], data]),
            Self::MaskWriteRegister { address, and_mask, or_mask } => join(&[
                &[fc::MASK_WRITE_REGISTER],
                &address.to_be_bytes(),
                &and_mask.to_be_bytes(),
                &or_mask.to_be_bytes(),
            ]),
            Self::ReadDeviceIdentification { code, conformity, more, next, count, objects } => join(&[
                &[
                    fc::ENCAPSULATED_INTERFACE,
                    fc::MEI_DEVICE_IDENTIFICATION,
                    code,
                    conformity,
                    more,
                    next,
                    count,
                ],
                objects,
            ]),
            Self::Exception { function, code } => join(&[&[function | fc::EXCEPTION, code]]),
            Self::Other { function, data } => join(&[&[function], data]),
        }
    }
}

/// The objects of a Read Device Identification reply: identifier and text. Stops where the bytes are cut short.
pub fn objects(mut bytes: &[u8]) -> impl Iterator<Item = (u8, &[u8])> {
    core::iter::from_fn(move || {
        let [id, length, rest @ ..] = bytes else {
            return None;
        };
        let (text, rest) = rest.split_at_checked(usize::from(*length))?;
        bytes = rest;
        Some((*id, text))
    })
}

fn emit_words(function: u8, words: Words<'_>) -> Pdu {
    join(&[&[function, words.as_bytes().len() as u8], words.as_bytes()])
}

fn identification(reply: &[u8], asked: u8, asked_object: u8) -> Result<Reply<'_>, Mismatch> {
    let [_, mei, code, conformity, more, next, count, objects @ ..] = reply else {
        return Err(wrong_length(7, reply.len()));
    };
    let same = |expected: u8, received: u8| {
        if expected == received {
            Ok(())
        } else {
            Err(Mismatch::Field { expected: expected.into(), received: received.into() })
        }
    };
    same(fc::MEI_DEVICE_IDENTIFICATION, *mei)?;
    same(asked, *code)?;
    match length::reply(reply) {
        Length::Known(length) if length == reply.len() => {}
        Length::Known(length) => return Err(wrong_length(length, reply.len())),
        _ => return Err(wrong_length(reply.len() + 1, reply.len())),
    }
    // One object was asked for (code 4): it must be that one.
    if asked == 4 {
        same(1, *count)?;
        same(asked_object, objects.first().copied().unwrap_or(!asked_object))?;
    }
    Ok(Reply::ReadDeviceIdentification {
        code: *code,
        conformity: *conformity,
        more: *more,
        next: *next,
        count: *count,
        objects,
    })
}

/// The data after a byte count that counts exactly them.
fn counted(data: &[u8]) -> Result<&[u8], Mismatch> {
    match data.split_first() {
        Some((&count, rest)) if usize::from(count) == rest.len() => Ok(rest),
        Some((&count, _)) => Err(wrong_length(1 + data.len(), 2 + usize::from(count))),
        None => Err(wrong_length(2, 1)),
    }
}

/// Checks that the words of `data` are those after the request's function code.
fn repeated(request: &[u8], data: &[u8]) -> Result<(), Mismatch> {
    let asked = request.get(1..).unwrap_or(&[]);
    for (expected, received) in asked.chunks(2).zip(data.chunks(2)) {
        if expected != received {
            return Err(Mismatch::Field { expected: wide(expected), received: wide(received) });
        }
    }
    Ok(())
}

fn wide(bytes: &[u8]) -> u16 {
    match bytes {
        [high, low, ..] => word(high, low),
        [low] => u16::from(*low),
        [] => 0,
    }
}

fn wrong_length(expected: usize, received: usize) -> Mismatch {
    let narrow = |length| u16::try_from(length).unwrap_or(u16::MAX);
    Mismatch::Length { expected: narrow(expected), received: narrow(received) }
}
