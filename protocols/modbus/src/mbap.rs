//! MBAP frames, that is Modbus/TCP: a header of seven bytes, then the PDU, no check (V1.0b, clause 3.1.3).

use core::fmt;

use crate::MAX_PDU;

/// Bytes of the header.
pub const HEADER: usize = 7;
/// Bytes of the longest frame.
pub const MAX_ADU: usize = HEADER + MAX_PDU;

/// The header of a frame; the protocol identifier is always 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Number that the client chose; the reply repeats it.
    pub transaction: u16,
    /// Unit behind the gateway; 0 or 255 mean the server itself.
    pub unit: u8,
    /// Bytes of the PDU that follows, 1 to 253.
    pub pdu_len: u8,
}

/// Why seven bytes are no header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeaderError {
    /// The protocol identifier is not 0. To pass over the frame: `length` bytes follow the first six of the header.
    Protocol {
        /// Protocol identifier.
        received: u16,
        /// Length field.
        length: u16,
    },
    /// The length field, unit and PDU together, is not within 2 to 254. The stream cannot be followed any further.
    Length {
        /// Length field.
        received: u16,
    },
}

impl Header {
    /// Reads a header.
    ///
    /// # Errors
    /// `Protocol` before `Length`.
    pub fn parse(bytes: &[u8; HEADER]) -> Result<Self, HeaderError> {
        let [t1, t0, p1, p0, l1, l0, unit] = *bytes;
        let length = u16::from_be_bytes([l1, l0]);
        match u16::from_be_bytes([p1, p0]) {
            0 => {}
            received => return Err(HeaderError::Protocol { received, length }),
        }
        match u8::try_from(length) {
            Ok(length @ 2..=254) => {
                Ok(Self { transaction: u16::from_be_bytes([t1, t0]), unit, pdu_len: length - 1 })
            }
            _ => Err(HeaderError::Length { received: length }),
        }
    }
}

impl fmt::Display for HeaderError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Protocol { received, .. } => {
                write!(f, "the protocol identifier is {received} instead of 0")
            }
            Self::Length { received } => write!(f, "the length is {received}, not within 2 to 254"),
        }
    }
}

impl core::error::Error for HeaderError {}

/// A frame; empty where the PDU is empty or longer than [`MAX_PDU`].
pub fn emit(transaction: u16, unit: u8, pdu: &[u8]) -> heapless::Vec<u8, MAX_ADU> {
    let mut adu = heapless::Vec::new();
    write(&mut adu, transaction, unit, pdu);
    adu
}

/// Writes such a frame into an empty vector.
pub fn write(adu: &mut heapless::Vec<u8, MAX_ADU>, transaction: u16, unit: u8, pdu: &[u8]) {
    let Some(length @ 2..=254) = u8::try_from(pdu.len()).ok().and_then(|len| len.checked_add(1)) else {
        return;
    };
    let [t1, t0] = transaction.to_be_bytes();
    // At most HEADER + MAX_PDU = MAX_ADU bytes, so that nothing is refused.
    let _ = adu.extend_from_slice(&[t1, t0, 0, 0, 0, length, unit]);
    let _ = adu.extend_from_slice(pdu);
}
