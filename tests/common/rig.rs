//! A gateway that commands simulated drives.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use puente_cell::{Cell, Config};
use puente_emulator::Setup;
use puente_modbus::Mode;

use super::client::{Lines, Modbus, figure, read_pdu, value};
use super::wire::{Wire, cell};
use super::{Gateway, axis, bus, thesis, until};

pub const ENABLE: u16 = 0x1023;
pub const FORWARD: u16 = 0x1024;
pub const REVERSE: u16 = 0x1025;

/// A gateway with a cell of three EDB drives on the line of the thesis: axes x, y and z.
pub struct Rig {
    pub wire: Wire<Cell>,
    pub gateway: Gateway,
}

fn settings(mode: Mode, wire: &Wire<Cell>, lease_ms: u64, more: &str) -> String {
    let axes = ["x", "y", "z"].iter().zip(1..).map(|(name, address)| axis(name, address));
    format!("[net]\nlease_ms = {lease_ms}\n")
        + &bus("a", mode, thesis(), &wire.port(), more)
        + &axes.collect::<String>()
}

impl Rig {
    pub fn new(mode: Mode, lease_ms: u64) -> Self {
        Self::with(mode, lease_ms, "")
    }

    /// With more keys of the bus.
    pub fn with(mode: Mode, lease_ms: u64, more: &str) -> Self {
        let wire = cell(mode, thesis(), &[1, 2, 3]);
        let gateway = Gateway::start(&settings(mode, &wire, lease_ms, more));
        Self { wire, gateway }
    }

    /// With a board's factory settings: on the emulated board where the variable `PUENTE_IMAGE` names the firmware,
    /// and otherwise on this machine.
    pub fn on_target() -> Self {
        if std::env::var_os("PUENTE_IMAGE").is_some() {
            return Self::on_board(|_| {});
        }
        let wire = Self::factory_wire();
        let gateway = Gateway::start(&settings(Mode::Ascii, &wire, 250, ""));
        Self { wire, gateway }
    }

    fn factory_wire() -> Wire<Cell> {
        Wire::tcp(Cell::new(Config::new(Mode::Ascii, thesis(), &[1, 2, 3])))
    }

    /// On the emulated board, with more or less connected to it.
    pub fn on_board(change: impl FnOnce(&mut Setup)) -> Self {
        let image = std::env::var_os("PUENTE_IMAGE").expect("PUENTE_IMAGE names the firmware");
        let wire = Self::factory_wire();
        let mut setup = Setup::new(image, wire.address().expect("on a port"));
        change(&mut setup);
        Self { gateway: Gateway::on_board(&setup), wire }
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
    const PIPELINED: usize = 8;

    pub fn start(address: SocketAddr) -> Self {
        let running = Arc::new(AtomicBool::new(true));
        let flood = |number: u8| {
            let running = running.clone();
            thread::spawn(move || {
                let mut client = Modbus::connect(address);
                let ask = |client: &mut Modbus| client.send(1 + number % 3, &read_pdu(0x0901, 1));
                (0..Self::PIPELINED).for_each(|_| {
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
        until("the queue is full", || {
            figure(&watcher.ok("bus a status"), "waiting") > u64::from(Self::CLIENTS) * 4
        });
        flood
    }

    pub fn end(self) {
        self.running.store(false, Ordering::Relaxed);
        for thread in self.threads {
            assert!(thread.join().expect("a client") > 0, "every client of the flood was served");
        }
    }
}
