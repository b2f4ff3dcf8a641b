//! A framed line with simulated modules, and a client that speaks as a station there.

use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::time::Duration;

use puente_cell::framed::{Cell, Config};
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Class, Decoder, Kind, Reason, section};
use puente_line::{Instant, Settings};
use puente_modules::{Control, Form, Order, Setting};

use super::client::connect;
use super::wire::{Device, Wire};

/// A line's times that an emulated UART and a busy machine keep, in characters.
pub const IPG: u16 = 20;
pub const SLOT: u16 = 100;

/// The line of these tests.
pub fn line() -> Settings {
    Settings { baud: 57_600, format: "8N1".parse().expect("a format") }
}

/// Keys of its bus.
pub fn keys(more: &str) -> String {
    format!("ipg = {IPG}\nslot = {SLOT}\ncycle_ms = 50\n{more}")
}

impl Device for Cell {
    fn receive(&mut self, now: Instant, bytes: &[u8]) {
        Cell::receive(self, 0, now, bytes);
    }

    fn poll(&mut self, now: Instant) -> Option<Vec<u8>> {
        Cell::poll(self, 0, now)
    }

    fn poll_at(&self) -> Option<Instant> {
        Cell::poll_at(self)
    }

    fn requests(&mut self) -> Vec<(Instant, u8, Vec<u8>)> {
        Vec::new()
    }
}

/// A wire with modules on it, whose far end hears itself.
pub fn modules(addresses: &[u8]) -> Wire<Cell> {
    let mut config = Config::new(line(), addresses);
    config.manners.gap = line().wire_time(IPG.into());
    config.manners.slot = line().wire_time(SLOT.into());
    config.manners.rest = config.manners.slot;
    Wire::new(Cell::new(config).expect("a cell"))
}

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
    let setting = Setting { kp: 1.0, ki: 0.0, kd: 0.0, set_point, order };
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

    /// Sends a frame and gives what comes next.
    #[track_caller]
    pub fn ask(&mut self, bytes: &[u8]) -> Packet {
        self.send(bytes);
        self.receive()
    }
}
