//! A gateway that commands simulated drives.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use puente_cell::Cell;
use puente_emulator::Setup;
use puente_modbus::Mode;

use super::client::{Lines, Modbus, figure, read_pdu, value};
use super::wire::{Wire, cell};
use super::{Document, Gateway, target, thesis, until};

pub const ENABLE: u16 = 0x1023;
pub const FORWARD: u16 = 0x1024;
pub const REVERSE: u16 = 0x1025;

/// A gateway with a cell of three EDB drives on the line of the thesis: axes x, y and z.
pub struct Rig {
    pub wire: Wire<Cell>,
    pub gateway: Gateway,
}

impl Rig {
    pub fn new(mode: Mode, lease_ms: u64) -> Self {
        Self::with(mode, lease_ms, "")
    }

    /// With more keys of the bus.
    pub fn with(mode: Mode, lease_ms: u64, more: &str) -> Self {
        let wire = cell(mode, thesis(), &[1, 2, 3]);
        let gateway = Self::document(mode, lease_ms, &wire, more).start();
        Self { wire, gateway }
    }

    /// On the emulated board with its factory settings, and more or less connected to it.
    pub fn on_board(change: impl FnOnce(&mut Setup)) -> Self {
        let image = target().image.as_ref().expect("PUENTE_IMAGE names the firmware");
        let wire = cell(Mode::Ascii, thesis(), &[1, 2, 3]);
        wire.go_live();
        let mut setup = Setup::new(image, wire.place.address().expect("a port"));
        change(&mut setup);
        Self { gateway: Gateway::on_board(&setup), wire }
    }

    /// The settings for its cell on `wire`.
    pub fn document(mode: Mode, lease_ms: u64, wire: &Wire<Cell>, more: &str) -> Document {
        let document = Document::new().net(&format!("lease_ms = {lease_ms}"));
        let axes = ["x", "y", "z"].into_iter().zip(1..);
        let bus = document.bus("a", mode, thesis(), wire, more);
        axes.fold(bus, |document, (name, address)| document.axis(name, "a", address, ""))
    }

    /// A console that jogs x forward; and when that was confirmed.
    pub fn jogging(&self) -> (Lines, Instant) {
        let mut commander = Lines::connect(self.gateway.main);
        commander.ok("axis x enable");
        commander.ok("axis x jog 100");
        let confirmed = Instant::now();
        assert!(self.turns());
        (commander, confirmed)
    }

    /// Whether x is commanded to turn.
    pub fn turns(&self) -> bool {
        let cell = self.wire.device();
        let drive = cell.drive(1).expect("drive 1");
        [FORWARD, REVERSE].iter().any(|register| drive.read(*register) == Ok(1))
    }

    /// Waits for the stop of x after `lost`: how many frames were before it on the line, and how late it was.
    pub fn stop_after(&self, lost: Instant) -> (usize, Duration) {
        let is_stop = |pdu: &[u8]| matches!(pdu, [6, 0x10, 0x24 | 0x25, 0, 0]);
        let mut found = None;
        until("a stop on the wire", || {
            let requests = self.wire.requests();
            let after: Vec<_> = requests.iter().filter(|request| request.at > lost).collect();
            let at = after.iter().position(|request| request.unit == 1 && is_stop(&request.pdu));
            found = at.map(|at| (at, after[at].at - lost));
            found.is_some()
        });
        let (before, late) = found.expect("a stop");
        until("x is commanded to stand", || !self.turns());
        (before, late)
    }

    pub fn event(&self) -> String {
        let mut status = String::new();
        until("a status", || {
            status = Lines::connect(self.gateway.main).ask("axis x status");
            status.starts_with("ok")
        });
        value(&status, "event").unwrap_or("none").to_owned()
    }
}

/// Ten clients that keep the queue full of readings of all drives.
pub struct Flood {
    running: Arc<AtomicBool>,
    threads: Vec<JoinHandle<u32>>,
}

impl Flood {
    const CLIENTS: u8 = 10;

    pub fn start(address: SocketAddr) -> Self {
        let running = Arc::new(AtomicBool::new(true));
        let flood = |number: u8| {
            let running = running.clone();
            let mut client = Modbus::served(address);
            thread::spawn(move || {
                let ask = |client: &mut Modbus| client.send(1 + number % 3, &read_pdu(0x0901, 1));
                (0..target().room / usize::from(Self::CLIENTS)).for_each(|_| {
                    ask(&mut client);
                });
                let mut answered = 0;
                while running.load(Ordering::Relaxed) {
                    client.receive();
                    answered += 1;
                    ask(&mut client);
                }
                answered
            })
        };
        let threads = (0..Self::CLIENTS).map(flood).collect();
        let flood = Self { running, threads };
        let mut watcher = Lines::connect(address);
        let full = target().room as u64 / 2;
        until("the queue is full", || figure(&watcher.ok("bus a status"), "waiting") > full);
        flood
    }

    pub fn end(self) {
        self.running.store(false, Ordering::Relaxed);
        for thread in self.threads {
            assert!(thread.join().expect("a client") > 0, "every client of the flood was served");
        }
    }
}
