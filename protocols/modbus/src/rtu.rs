//! RTU frames: unit, PDU, CRC-16 with its low byte first; and the silences between them (serial line V1.02, clause 2.5.1).

use core::time::Duration;

use puente_line::Settings;

use crate::{FrameError, MAX_PDU};

/// Bytes of the longest frame.
pub const MAX_ADU: usize = 256;
/// Bytes of the shortest frame: unit, function code, CRC.
pub const MIN_ADU: usize = 4;

/// Bytes around the PDU: unit and CRC.
pub(crate) const OVERHEAD: usize = 3;

/// One table of 512 bytes: a byte per look-up, small enough for every board.
static CRC: crc::Crc<u16, crc::Table<1>> = crc::Crc::<u16, crc::Table<1>>::new(&crc::CRC_16_MODBUS);

/// CRC-16 of a frame's unit and PDU.
pub fn crc(bytes: &[u8]) -> u16 {
    CRC.checksum(bytes)
}

/// A frame; empty where the PDU is empty or longer than [`MAX_PDU`], so that nothing wrong gets onto a line.
pub fn emit(unit: u8, pdu: &[u8]) -> heapless::Vec<u8, MAX_ADU> {
    let mut adu = heapless::Vec::new();
    write(&mut adu, unit, pdu);
    adu
}

/// Writes a frame into an empty vector of [`MAX_ADU`] bytes at least.
pub(crate) fn write<const N: usize>(adu: &mut heapless::Vec<u8, N>, unit: u8, pdu: &[u8]) {
    const { assert!(N >= MAX_ADU) };
    if !(1..=MAX_PDU).contains(&pdu.len()) {
        return;
    }
    // At most 1 + MAX_PDU + 2 = MAX_ADU bytes, so that nothing is refused.
    let _ = adu.push(unit);
    let _ = adu.extend_from_slice(pdu);
    let check = crc(adu);
    let _ = adu.extend_from_slice(&check.to_le_bytes());
}

/// Unit and PDU of a frame.
///
/// # Errors
/// `TooShort`, `TooLong` or `Check`.
pub fn parse(adu: &[u8]) -> Result<(u8, &[u8]), FrameError> {
    if adu.len() < MIN_ADU {
        return Err(FrameError::TooShort);
    }
    if adu.len() > MAX_ADU {
        return Err(FrameError::TooLong);
    }
    let ([unit, pdu @ ..], [low, high]) = adu.split_at(adu.len() - 2) else {
        return Err(FrameError::TooShort);
    };
    let received = u16::from_le_bytes([*low, *high]);
    let expected = crc(&adu[..adu.len() - 2]);
    if received != expected {
        return Err(FrameError::Check { expected, received });
    }
    Ok((*unit, pdu))
}

/// Longest silence inside a frame: 1.5 characters, above 19200 baud always 750 us.
pub fn t1_5(line: Settings) -> Duration {
    half_characters(line, 3, Duration::from_micros(750))
}

/// Shortest silence between frames: 3.5 characters, above 19200 baud always 1750 us.
pub fn t3_5(line: Settings) -> Duration {
    half_characters(line, 7, Duration::from_micros(1750))
}

/// `halves` half characters, rounded up to a microsecond; `fixed` above 19200 baud (clause 2.5.1.1, remark).
fn half_characters(line: Settings, halves: usize, fixed: Duration) -> Duration {
    if line.baud > 19_200 {
        return fixed;
    }
    Duration::from_micros(puente_line::micros(line.wire_time(halves)).div_ceil(2))
}
