//! What has been on the bus, in a file: for people as `candump -L` has it, for Wireshark as pcap.

use std::io::{self, Write};

use puente_canopen::{Frame, Id};
use puente_line::{Instant, micros};

use crate::can::bus::Event;

/// LINKTYPE_CAN_SOCKETCAN.
const LINK_TYPE: u32 = 227;
/// Bits of an identifier there.
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;

/// A file that is written as the frames come. Times are those of the cell, from 1970 on.
pub enum Capture {
    /// Lines as `(1.002003) can0 182#3702`.
    Lines(Box<dyn Write>),
    /// pcap with link type 227.
    Pcap(Box<dyn Write>),
}

impl Capture {
    /// A pcap file, with its header.
    ///
    /// # Errors
    /// That of writing.
    pub fn pcap(mut to: Box<dyn Write>) -> io::Result<Self> {
        // Magic number of microseconds, version 2.4, time zone, accuracy, longest packet.
        to.write_all(&0xA1B2_C3D4_u32.to_le_bytes())?;
        to.write_all(&2_u16.to_le_bytes())?;
        to.write_all(&4_u16.to_le_bytes())?;
        for word in [0, 0, 0xFFFF, LINK_TYPE] {
            to.write_all(&word.to_le_bytes())?;
        }
        Ok(Self::Pcap(to))
    }

    /// Takes what has been on the bus; error frames are left out.
    ///
    /// # Errors
    /// That of writing.
    pub fn write(&mut self, event: &Event) -> io::Result<()> {
        let (Event::Frame(sent) | Event::Dropped(sent)) = event else { return Ok(()) };
        match self {
            Self::Lines(to) => {
                writeln!(to, "{}", line(sent.at, &sent.frame))?;
                to.flush()
            }
            Self::Pcap(to) => {
                to.write_all(&packet(sent.at, &sent.frame))?;
                to.flush()
            }
        }
    }
}

fn line(at: Instant, frame: &Frame) -> String {
    let id = match frame.id() {
        Id::Base(id) => format!("{id:03X}"),
        Id::Extended(id) => format!("{id:08X}"),
    };
    let data = match frame.is_remote() {
        true => format!("R{}", frame.length()),
        false => frame.data().iter().map(|byte| format!("{byte:02X}")).collect(),
    };
    let at = micros(at.since(Instant::ZERO));
    format!("({}.{:06}) can0 {id}#{data}", at / 1_000_000, at % 1_000_000)
}

fn packet(at: Instant, frame: &Frame) -> Vec<u8> {
    let extended = if matches!(frame.id(), Id::Extended(_)) { EXTENDED } else { 0 };
    let remote = if frame.is_remote() { REMOTE } else { 0 };
    let id = frame.id().raw() | extended | remote;
    let mut body = id.to_be_bytes().to_vec();
    body.extend_from_slice(&[frame.length(), 0, 0, 0]);
    body.extend_from_slice(frame.data());
    let at = micros(at.since(Instant::ZERO));
    let length = body.len() as u32;
    let head = [(at / 1_000_000) as u32, (at % 1_000_000) as u32, length, length];
    let mut packet: Vec<u8> = head.into_iter().flat_map(u32::to_le_bytes).collect();
    packet.extend_from_slice(&body);
    packet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_those_of_candump() {
        let at = Instant::from_micros(1_002_003);
        let frame = Frame::new(Id::base(0x182), &[0x37, 0x02]).unwrap();
        assert_eq!(line(at, &frame), "(1.002003) can0 182#3702");
        assert_eq!(line(at, &Frame::remote(Id::extended(0x702), 1)), "(1.002003) can0 00000702#R1");
    }

    #[test]
    fn a_packet_is_that_of_socketcan() {
        let frame = Frame::new(Id::extended(0x123), &[1, 2, 3]).unwrap();
        let expected = [
            1, 0, 0, 0, 0xD3, 0x07, 0, 0, 11, 0, 0, 0, 11, 0, 0, 0, // 1.002003 s, 11 bytes
            0x80, 0, 0x01, 0x23, 3, 0, 0, 0, 1, 2, 3,
        ];
        assert_eq!(packet(Instant::from_micros(1_002_003), &frame), expected);
    }
}
