//! What the fuzz targets share.

pub mod master;
pub mod nor;
pub mod visit;

use std::time::Duration;

use puente_line::Settings;
use puente_modbus::{Mode, ascii, rtu};

/// The line of all targets.
pub fn line() -> Settings {
    Settings { baud: 19_200, format: "8E1".parse().expect("a format") }
}

/// A frame in either framing.
pub fn adu(mode: Mode, unit: u8, pdu: &[u8]) -> Vec<u8> {
    match mode {
        Mode::Rtu => rtu::emit(unit, pdu).to_vec(),
        Mode::Ascii => ascii::emit(unit, pdu).to_vec(),
    }
}

/// Whether `bytes` hold the frame `adu`; in ASCII with digits of either case, and with or without CR.
pub fn holds(mode: Mode, bytes: &[u8], adu: &[u8]) -> bool {
    let adu = match mode {
        Mode::Rtu => adu,
        Mode::Ascii => adu.strip_suffix(b"\r\n").expect("a frame"),
    };
    bytes.windows(adu.len()).any(|window| match mode {
        Mode::Rtu => window == adu,
        Mode::Ascii => window.eq_ignore_ascii_case(adu),
    })
}

/// Reads the fuzzer's bytes as operands; zero once they are used up.
pub struct Operands<'a>(pub &'a [u8]);

impl<'a> Operands<'a> {
    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        self.bytes(1).first().copied().unwrap_or(0)
    }

    /// At most `count` bytes.
    pub fn bytes(&mut self, count: usize) -> &'a [u8] {
        let (bytes, rest) = self.0.split_at(count.min(self.0.len()));
        self.0 = rest;
        bytes
    }

    /// Up to 64 ms, or with the top bit up to 1.6 s.
    pub fn pause(&mut self) -> Duration {
        match self.byte() {
            short @ 0..0x80 => Duration::from_micros(500 * u64::from(short)),
            long => Duration::from_micros(12_500 * u64::from(long - 0x7F)),
        }
    }
}
