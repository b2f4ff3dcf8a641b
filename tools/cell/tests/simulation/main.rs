//! The cell on a mock clock.

mod dynamics;
mod exchanges;
mod faults;
mod pacing;

use std::time::Duration;

use puente_cell::{Cell, Config, Drive};
use puente_line::{Instant, Settings};
use puente_modbus::{Mode, ascii, rtu};

/// A cell and the master's clock.
struct Rig {
    cell: Cell,
    mode: Mode,
    now: Instant,
}

fn thesis_line() -> Settings {
    Settings { baud: 9_600, format: "8O1".parse().expect("format") }
}

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

impl Rig {
    fn new(config: Config) -> Self {
        Self { mode: config.mode, cell: Cell::new(config), now: Instant::from_millis(1_000) }
    }

    fn of(mode: Mode) -> Self {
        Self::new(Config::new(mode, thesis_line(), &[1, 2, 3]))
    }

    /// Lets time pass, polled only when the cell asks for it. Returns what came, each piece with its moment.
    fn pass(&mut self, time: Duration) -> Vec<(Instant, Vec<u8>)> {
        let end = self.now + time;
        let mut pieces = Vec::new();
        loop {
            let at = self.cell.poll_at().filter(|at| *at <= end).unwrap_or(end).max(self.now);
            self.now = at;
            let piece = self.cell.poll(at);
            let ended = at == end && piece.is_none();
            pieces.extend(piece.map(|bytes| (at, bytes)));
            if ended {
                return pieces;
            }
        }
    }

    /// Sends raw bytes and returns what comes within a second.
    fn raw(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.cell.receive(self.now, bytes);
        self.pass(ms(1_000)).into_iter().flat_map(|(_, piece)| piece).collect()
    }

    fn frame(&self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        match self.mode {
            Mode::Rtu => rtu::emit(unit, pdu).to_vec(),
            Mode::Ascii => ascii::emit(unit, pdu).to_vec(),
        }
    }

    /// Sends a request and returns the PDU of the reply, which must be a good frame of that unit.
    fn ask(&mut self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        let reply = self.raw(&self.frame(unit, pdu));
        match self.mode {
            Mode::Rtu => {
                let (from, pdu) = rtu::parse(&reply).expect("a good frame");
                assert_eq!(from, unit);
                pdu.to_vec()
            }
            Mode::Ascii => {
                let frame = ascii::parse(&reply).expect("a good frame");
                assert_eq!(frame.unit, unit);
                frame.pdu.to_vec()
            }
        }
    }

    fn read(&mut self, unit: u8, address: u16) -> u16 {
        let [high, low] = address.to_be_bytes();
        match self.ask(unit, &[0x03, high, low, 0, 1])[..] {
            [0x03, 2, high, low] => u16::from_be_bytes([high, low]),
            ref reply => panic!("{reply:02X?}"),
        }
    }

    fn write(&mut self, unit: u8, address: u16, value: u16) {
        let pdu = [&[0x06], &address.to_be_bytes()[..], &value.to_be_bytes()].concat();
        assert_eq!(self.ask(unit, &pdu), pdu, "the reply repeats the request");
    }

    fn drive(&self, unit: u8) -> &Drive {
        self.cell.drive(unit).expect("a drive")
    }

    fn drive_mut(&mut self, unit: u8) -> &mut Drive {
        self.cell.drive_mut(unit).expect("a drive")
    }
}
