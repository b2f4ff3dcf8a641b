//! What the tests share.
#![allow(dead_code)]

use puente_framed::frame::{self, Kind, MAX_FRAME};
use puente_framed::section;
use puente_line::Settings;

pub fn line() -> Settings {
    Settings { baud: 1_000_000, format: "8N1".parse().expect("format") }
}

/// Sections, each an address and its data.
pub fn body(sections: &[(u8, &[u8])]) -> Vec<u8> {
    let mut body = heapless::Vec::<u8, MAX_FRAME>::new();
    for (address, data) in sections {
        section::push(&mut body, *address, data).expect("room");
    }
    body.to_vec()
}

pub fn emit(origin: u8, kind: Kind, body: &[u8]) -> Vec<u8> {
    let mut buffer = heapless::Vec::<u8, MAX_FRAME>::new();
    frame::emit(&mut buffer, origin, kind, body).expect("a frame");
    buffer.to_vec()
}

/// Bytes written in hexadecimal, with comments from `#` on.
pub fn hex(text: &str) -> Vec<u8> {
    let code = text.lines().map(|line| line.split('#').next().unwrap_or_default());
    let bytes = code.flat_map(str::split_whitespace);
    bytes.map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect()
}
