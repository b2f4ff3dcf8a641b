//! Request PDUs (V1.1b3, clause 6).

use crate::function as fc;
use crate::{Exception, Pdu, Words, join};

/// A request, over the bytes of its PDU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request<'a> {
    /// 01 Read Coils.
    ReadCoils {
        /// First coil.
        address: u16,
        /// Coils, 1 to 2000.
        quantity: u16,
    },
    /// 02 Read Discrete Inputs.
    ReadDiscreteInputs {
        /// First input.
        address: u16,
        /// Inputs, 1 to 2000.
        quantity: u16,
    },
    /// 03 Read Holding Registers.
    ReadHoldingRegisters {
        /// First register.
        address: u16,
        /// Registers, 1 to 125.
        quantity: u16,
    },
    /// 04 Read Input Registers.
    ReadInputRegisters {
        /// First register.
        address: u16,
        /// Registers, 1 to 125.
        quantity: u16,
    },
    /// 05 Write Single Coil.
    WriteSingleCoil {
        /// The coil.
        address: u16,
        /// Its state: FF00h or 0000h on the wire.
        on: bool,
    },
    /// 06 Write Single Register.
    WriteSingleRegister {
        /// The register.
        address: u16,
        /// Its value.
        value: u16,
    },
    /// 08 Diagnostics.
    Diagnostics {
        /// What to diagnose.
        sub_function: u16,
        /// Data of the sub-function; the specification has whole words, most often one.
        data: &'a [u8],
    },
    /// 0F Write Multiple Coils.
    WriteMultipleCoils {
        /// First coil.
        address: u16,
        /// Coils, 1 to 1968.
        quantity: u16,
        /// Eight coils a byte, the first in the lowest bit.
        bits: &'a [u8],
    },
    /// 10 Write Multiple Registers.
    WriteMultipleRegisters {
        /// First register.
        address: u16,
        /// 1 to 123 values.
        words: Words<'a>,
    },
    /// 11 Report Server ID.
    ReportServerId,
    /// 16 Mask Write Register: new = (current AND and) OR (or AND NOT and).
    MaskWriteRegister {
        /// The register.
        address: u16,
        /// Bits to keep.
        and_mask: u16,
        /// Bits to set where not kept.
        or_mask: u16,
    },
    /// 17 Read/Write Multiple Registers: writes, then reads.
    ReadWriteMultipleRegisters {
        /// First register to read.
        read_address: u16,
        /// Registers to read, 1 to 125.
        read_quantity: u16,
        /// First register to write.
        write_address: u16,
        /// 1 to 121 values.
        words: Words<'a>,
    },
    /// 2B/0E Read Device Identification.
    ReadDeviceIdentification {
        /// Category: 1 basic, 2 regular, 3 extended, 4 one object.
        code: u8,
        /// First object, or the one.
        object: u8,
    },
    /// Any other function.
    Other {
        /// Function code, 1 to 7Fh.
        function: u8,
        /// All that follows it.
        data: &'a [u8],
    },
}

/// How long the PDU of a normal reply is. An exception is always two bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyLength {
    /// So many bytes.
    Exact(usize),
    /// As the reply itself says (11, 2B/0E).
    Counted,
    /// Not known; silence ends an RTU frame.
    Unknown,
    /// No normal reply is defined: 08/04 Force Listen Only Mode.
    Never,
}

/// Diagnostics sub-function after which a server keeps silent.
const FORCE_LISTEN_ONLY: u16 = 4;

impl<'a> Request<'a> {
    /// Reads a request.
    ///
    /// # Errors
    /// What a server answers: `IllegalFunction` for no function code, 0 or 80h and above; `IllegalDataValue` for a wrong
    /// structure, quantity, byte count or coil value. Addresses are the server's business.
    pub fn parse(pdu: &'a [u8]) -> Result<Self, Exception> {
        match pdu {
            [] | [0 | fc::EXCEPTION..=0xFF, ..] => Err(Exception::IllegalFunction),
            [fc::READ_COILS, data @ ..] => {
                let (address, quantity) = span(data, 2000)?;
                Ok(Self::ReadCoils { address, quantity })
            }
            [fc::READ_DISCRETE_INPUTS, data @ ..] => {
                let (address, quantity) = span(data, 2000)?;
                Ok(Self::ReadDiscreteInputs { address, quantity })
            }
            [fc::READ_HOLDING_REGISTERS, data @ ..] => {
                let (address, quantity) = span(data, 125)?;
                Ok(Self::ReadHoldingRegisters { address, quantity })
            }
            [fc::READ_INPUT_REGISTERS, data @ ..] => {
                let (address, quantity) = span(data, 125)?;
                Ok(Self::ReadInputRegisters { address, quantity })
            }
            [fc::WRITE_SINGLE_COIL, a1, a0, state @ (0x00 | 0xFF), 0] => {
                Ok(Self::WriteSingleCoil { address: word(a1, a0), on: *state == 0xFF })
            }
            [fc::WRITE_SINGLE_REGISTER, a1, a0, v1, v0] => {
                Ok(Self::WriteSingleRegister { address: word(a1, a0), value: word(v1, v0) })
            }
            [fc::DIAGNOSTICS, s1, s0, data @ ..] => {
                Ok(Self::Diagnostics { sub_function: word(s1, s0), data })
            }
            [fc::WRITE_MULTIPLE_COILS, a1, a0, q1, q0, count, bits @ ..] => {
                let quantity = within(word(q1, q0), 1968)?;
                counted(bits, *count, usize::from(quantity).div_ceil(8))?;
                Ok(Self::WriteMultipleCoils { address: word(a1, a0), quantity, bits })
            }
            [fc::WRITE_MULTIPLE_REGISTERS, a1, a0, q1, q0, count, values @ ..] => {
                let quantity = within(word(q1, q0), 123)?;
                counted(values, *count, 2 * usize::from(quantity))?;
                Ok(Self::WriteMultipleRegisters { address: word(a1, a0), words: Words::from_bytes(values) })
            }
            [fc::REPORT_SERVER_ID] => Ok(Self::ReportServerId),
            [fc::MASK_WRITE_REGISTER, a1, a0, n1, n0, o1, o0] => Ok(Self::MaskWriteRegister {
                address: word(a1, a0),
                and_mask: word(n1, n0),
                or_mask: word(o1, o0),
            }),
            [fc::READ_WRITE_MULTIPLE_REGISTERS, r1, r0, n1, n0, w1, w0, q1, q0, count, values @ ..] => {
                let read_quantity = within(word(n1, n0), 125)?;
                let write_quantity = within(word(q1, q0), 121)?;
                counted(values, *count, 2 * usize::from(write_quantity))?;
                Ok(Self::ReadWriteMultipleRegisters {
                    read_address: word(r1, r0),
                    read_quantity,
                    write_address: word(w1, w0),
                    words: Words::from_bytes(values),
                })
            }
            [fc::ENCAPSULATED_INTERFACE, fc::MEI_DEVICE_IDENTIFICATION, code @ 1..=4, object] => {
                Ok(Self::ReadDeviceIdentification { code: *code, object: *object })
            }
            [fc::ENCAPSULATED_INTERFACE, fc::MEI_DEVICE_IDENTIFICATION, ..] => {
                Err(Exception::IllegalDataValue)
            }
            [function, data @ ..] if *function == fc::ENCAPSULATED_INTERFACE || !is_typed(*function) => {
                Ok(Self::Other { function: *function, data })
            }
            _ => Err(Exception::IllegalDataValue),
        }
    }

    /// The PDU; empty where it would not fit one. Quantities are not checked: [`Request::parse`] does that.
    pub fn emit(&self) -> Pdu {
        let function = self.function();
        match *self {
            Self::ReadCoils { address, quantity }
            | Self::ReadDiscreteInputs { address, quantity }
            | Self::ReadHoldingRegisters { address, quantity }
            | Self::ReadInputRegisters { address, quantity } => {
                join(&[&[function], &address.to_be_bytes(), &quantity.to_be_bytes()])
            }
            Self::WriteSingleCoil { address, on } => join(&[&[function], &address.to_be_bytes(), &coil(on)]),
            Self::WriteSingleRegister { address, value } => {
                join(&[&[function], &address.to_be_bytes(), &value.to_be_bytes()])
            }
            Self::Diagnostics { sub_function, data } => {
                join(&[&[function], &sub_function.to_be_bytes(), data])
            }
            Self::WriteMultipleCoils { address, quantity, bits } => join(&[
                &[function],
                &address.to_be_bytes(),
                &quantity.to_be_bytes(),
                &[bits.len() as u8],
                bits,
            ]),
            Self::WriteMultipleRegisters { address, words } => join(&[
                &[function],
                &address.to_be_bytes(),
                &quantity(words).to_be_bytes(),
                &[words.as_bytes().len() as u8],
                words.as_bytes(),
            ]),
            Self::ReportServerId => join(&[&[function]]),
            Self::MaskWriteRegister { address, and_mask, or_mask } => {
                join(&[&[function], &address.to_be_bytes(), &and_mask.to_be_bytes(), &or_mask.to_be_bytes()])
            }
            Self::ReadWriteMultipleRegisters { read_address, read_quantity, write_address, words } => {
                join(&[
                    &[function],
                    &read_address.to_be_bytes(),
                    &read_quantity.to_be_bytes(),
                    &write_address.to_be_bytes(),
                    &quantity(words).to_be_bytes(),
                    &[words.as_bytes().len() as u8],
                    words.as_bytes(),
                ])
            }
            Self::ReadDeviceIdentification { code, object } => {
                join(&[&[function, fc::MEI_DEVICE_IDENTIFICATION, code, object]])
            }
            Self::Other { data, .. } => join(&[&[function], data]),
        }
    }

    /// The function code.
    pub fn function(&self) -> u8 {
        match *self {
            Self::ReadCoils { .. } => fc::READ_COILS,
            Self::ReadDiscreteInputs { .. } => fc::READ_DISCRETE_INPUTS,
            Self::ReadHoldingRegisters { .. } => fc::READ_HOLDING_REGISTERS,
            Self::ReadInputRegisters { .. } => fc::READ_INPUT_REGISTERS,
            Self::WriteSingleCoil { .. } => fc::WRITE_SINGLE_COIL,
            Self::WriteSingleRegister { .. } => fc::WRITE_SINGLE_REGISTER,
            Self::Diagnostics { .. } => fc::DIAGNOSTICS,
            Self::WriteMultipleCoils { .. } => fc::WRITE_MULTIPLE_COILS,
            Self::WriteMultipleRegisters { .. } => fc::WRITE_MULTIPLE_REGISTERS,
            Self::ReportServerId => fc::REPORT_SERVER_ID,
            Self::MaskWriteRegister { .. } => fc::MASK_WRITE_REGISTER,
            Self::ReadWriteMultipleRegisters { .. } => fc::READ_WRITE_MULTIPLE_REGISTERS,
            Self::ReadDeviceIdentification { .. } => fc::ENCAPSULATED_INTERFACE,
            Self::Other { function, .. } => function,
        }
    }

    /// Length of the normal reply.
    pub fn expected(&self) -> ReplyLength {
        match *self {
            Self::ReadCoils { quantity, .. } | Self::ReadDiscreteInputs { quantity, .. } => {
                ReplyLength::Exact(2 + usize::from(quantity).div_ceil(8))
            }
            Self::ReadHoldingRegisters { quantity, .. }
            | Self::ReadInputRegisters { quantity, .. }
            | Self::ReadWriteMultipleRegisters { read_quantity: quantity, .. } => {
                ReplyLength::Exact(2 + 2 * usize::from(quantity))
            }
            Self::WriteSingleCoil { .. }
            | Self::WriteSingleRegister { .. }
            | Self::WriteMultipleCoils { .. }
            | Self::WriteMultipleRegisters { .. } => ReplyLength::Exact(5),
            Self::Diagnostics { sub_function: FORCE_LISTEN_ONLY, .. } => ReplyLength::Never,
            Self::Diagnostics { data, .. } => ReplyLength::Exact(3 + data.len()),
            Self::MaskWriteRegister { .. } => ReplyLength::Exact(7),
            Self::ReportServerId | Self::ReadDeviceIdentification { .. } => ReplyLength::Counted,
            Self::Other { .. } => ReplyLength::Unknown,
        }
    }

    /// Whether it may change the server, so that it must not be repeated unasked. True for all that is not known to only
    /// read: of Diagnostics, only 00 (echo), 02 and 0B to 12h (registers and counters) are.
    pub fn is_write(&self) -> bool {
        match *self {
            Self::ReadCoils { .. }
            | Self::ReadDiscreteInputs { .. }
            | Self::ReadHoldingRegisters { .. }
            | Self::ReadInputRegisters { .. }
            | Self::ReportServerId
            | Self::ReadDeviceIdentification { .. } => false,
            Self::Diagnostics { sub_function, .. } => !matches!(sub_function, 0 | 2 | 0x0B..=0x12),
            _ => true,
        }
    }
}

fn is_typed(function: u8) -> bool {
    matches!(
        function,
        fc::READ_COILS..=fc::WRITE_SINGLE_REGISTER
            | fc::DIAGNOSTICS
            | fc::WRITE_MULTIPLE_COILS..=fc::REPORT_SERVER_ID
            | fc::MASK_WRITE_REGISTER
            | fc::READ_WRITE_MULTIPLE_REGISTERS
    )
}

/// Address and quantity of a read.
fn span(data: &[u8], most: u16) -> Result<(u16, u16), Exception> {
    match data {
        [a1, a0, q1, q0] => Ok((word(a1, a0), within(word(q1, q0), most)?)),
        _ => Err(Exception::IllegalDataValue),
    }
}

fn within(quantity: u16, most: u16) -> Result<u16, Exception> {
    if (1..=most).contains(&quantity) { Ok(quantity) } else { Err(Exception::IllegalDataValue) }
}

/// Checks that byte count and data are what the quantity calls for.
fn counted(data: &[u8], count: u8, needed: usize) -> Result<(), Exception> {
    if data.len() == needed && usize::from(count) == needed {
        Ok(())
    } else {
        Err(Exception::IllegalDataValue)
    }
}

/// Number of registers; more than a PDU holds is refused by its length anyway.
fn quantity(words: Words<'_>) -> u16 {
    u16::try_from(words.len()).unwrap_or(u16::MAX)
}

pub(crate) const fn coil(on: bool) -> [u8; 2] {
    if on { [0xFF, 0] } else { [0, 0] }
}

pub(crate) const fn word(high: &u8, low: &u8) -> u16 {
    u16::from_be_bytes([*high, *low])
}
