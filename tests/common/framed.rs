//! A client that speaks as a station of a framed line.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::time::Duration;

use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Class, Decoder, Kind, Reason, section};
use puente_modules::{Control, Form, Order, Setting};

use super::client::connect;

/// A frame of one section for each address.
pub fn packet(origin: u8, kind: Kind, sections: &[(u8, &[u8])]) -> Vec<u8> {
    let mut body = heapless::Vec::<u8, MAX_FRAME>::new();
    for (address, data) in sections {
        section::push(&mut body, *address, data).expect("room");
    }
    let mut bytes = heapless::Vec::<u8, MAX_FRAME>::new();
    frame::emit(&mut bytes, origin, kind, &body).expect("a frame");
    bytes.to_vec()
}

/// A setting, as text.
pub fn setting(set_point: f32, control: Option<Control>) -> Vec<u8> {
    let order = control.map(|control| Order { control, ask: true });
    let setting = Setting { kp: 0.001, ki: 0.0, kd: 0.000_002, set_point, order };
    setting.emit(Form::Text).expect("a setting").to_vec()
}

/// What one station wants of one module, which is to report.
pub fn wish(origin: u8, module: u8, control: Control, set_point: f32) -> Vec<u8> {
    packet(origin, Kind::Single(Class::Data), &[(module, &setting(set_point, Some(control)))])
}

/// A frame as a client gets it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    pub origin: u8,
    pub kind: Kind,
    pub sections: Vec<(u8, Vec<u8>)>,
}

impl Packet {
    /// Why the gateway refuses a frame, if it does, and the LRC of that.
    pub fn refusal(&self) -> Option<(Reason, u8)> {
        match self.kind {
            Kind::Refusal { reason, .. } => Some((reason, self.sections[0].1.first().copied()?)),
            _ => None,
        }
    }
}

/// A client of dialect 7E.
pub struct Packets {
    pub stream: TcpStream,
    decoder: Decoder<MAX_FRAME>,
}

impl Packets {
    pub fn connect(address: SocketAddr) -> Self {
        Self { stream: connect(address), decoder: Decoder::new() }
    }

    #[track_caller]
    pub fn send(&mut self, bytes: &[u8]) {
        self.stream.write_all(bytes).expect("sent");
    }

    /// Closes the client's side.
    pub fn close(&mut self) {
        self.stream.shutdown(Shutdown::Write).expect("closed");
    }

    /// The next frame; none where the gateway closes, or says nothing for `time`.
    pub fn next_within(&mut self, time: Duration) -> Option<Packet> {
        self.stream.set_read_timeout(Some(time)).expect("a timeout");
        loop {
            if self.decoder.is_ready() && self.decoder.advance() {
                let frame = self.decoder.frame().expect("a frame");
                let sections = frame.sections().map(|s| (s.address, s.data.to_vec())).collect();
                return Some(Packet { origin: frame.origin, kind: frame.kind, sections });
            }
            let mut byte = [0];
            match self.stream.read(&mut byte) {
                Ok(1) => self.decoder.push(byte[0]),
                _ => return None,
            }
        }
    }

    #[track_caller]
    pub fn receive(&mut self) -> Packet {
        self.next_within(Duration::from_secs(20)).expect("a frame")
    }

    /// Sends a frame and gives what comes next. On a busy machine an answer may meet another frame and be late, so that it
    /// is asked for again.
    #[track_caller]
    pub fn ask(&mut self, bytes: &[u8]) -> Packet {
        for _ in 0..20 {
            self.send(bytes);
            if let Some(packet) = self.next_within(Duration::from_secs(1)) {
                return packet;
            }
        }
        panic!("no answer to {bytes:02x?}")
    }
}
