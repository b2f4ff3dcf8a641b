//! A framed line in this process, in real time: modules on the axes of a simulated table, and a port for each gateway.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use puente_cell::framed::{Cell, Config, Module};
use puente_cell::live::{self, Port, Ports};
use puente_line::Settings;

use super::wire::Place;
use super::{ms, scratch, until};

/// What is on the line is heard late by so much at most, as with an adapter that collects characters: one at a time they
/// would take all of a busy machine.
const REST: Duration = ms(2);

/// What a gateway is connected to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Connector {
    /// A pseudo terminal, for a gateway on this machine.
    Pty,
    /// A TCP port, for the UART of an emulated board, which is to hear nothing before it has its settings.
    Uart,
}

/// The line with its modules. It lives as long as this value.
pub struct Table {
    cell: Arc<Mutex<Cell>>,
    pub line: Settings,
    connectors: Vec<(Place, Arc<AtomicBool>)>,
    /// How often the line has caught up with the time.
    turns: Arc<AtomicU64>,
    running: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Table {
    /// A line with these connectors, whatever the configuration says of ports.
    pub fn new(config: Config, connectors: &[Connector]) -> Self {
        let line = config.manners.line;
        let cell = Cell::new(Config { ports: connectors.len(), ..config }).expect("a cell");
        let (ports, connectors): (Vec<_>, Vec<_>) = connectors.iter().map(|kind| open(*kind, line)).unzip();
        let mut table = Self {
            cell: Arc::new(Mutex::new(cell)),
            line,
            connectors,
            turns: Arc::default(),
            running: Arc::new(AtomicBool::new(true)),
            thread: None,
        };
        table.start(ports);
        table
    }

    fn start(&mut self, ports: Vec<Port>) {
        let (cell, turns, running) = (self.cell.clone(), self.turns.clone(), self.running.clone());
        let live: Vec<_> = self.connectors.iter().map(|(_, live)| live.clone()).collect();
        self.thread = Some(thread::spawn(move || {
            live::exact_timers();
            let mut ports = Ports::new(ports, REST);
            while running.load(Ordering::Relaxed) {
                for (at, live) in live.iter().enumerate() {
                    ports.connect(at, live.load(Ordering::Relaxed));
                }
                let next = {
                    let mut cell = cell.lock().expect("the cell");
                    ports.carry(&mut cell).expect("the ports are there");
                    cell.poll_at()
                };
                turns.fetch_add(1, Ordering::Relaxed);
                ports.wait(next).expect("the ports are there");
            }
        }));
    }

    /// Where a gateway finds the line, and how it is told that the gateway has its settings.
    pub(super) fn connector(&self, at: usize) -> (Place, Arc<AtomicBool>) {
        self.connectors[at].clone()
    }

    /// The cell, to look at or to change.
    pub fn cell(&self) -> MutexGuard<'_, Cell> {
        self.cell.lock().expect("the cell")
    }

    /// Something of the module at this address.
    pub fn of<T>(&self, address: u8, what: impl FnOnce(&Module) -> T) -> T {
        what(self.cell().module(address).expect("a module"))
    }

    /// Where an axis is, in counts: of its plant, whatever the module thinks.
    pub fn position(&self, address: u8) -> f64 {
        self.of(address, |module| module.plant().position())
    }

    /// Returns when all is on the line that had been sent before.
    pub fn settle(&self) {
        // The turn that is in progress may have looked at a port already.
        let seen = self.turns.load(Ordering::Relaxed);
        until("the line catches up", || self.turns.load(Ordering::Relaxed) >= seen + 2);
    }
}

impl Drop for Table {
    fn drop(&mut self) {
        self.running.store(false, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        for (place, _) in &self.connectors {
            if let Place::Link(link) = place {
                let _ = fs::remove_file(link);
            }
        }
    }
}

fn open(kind: Connector, line: Settings) -> (Port, (Place, Arc<AtomicBool>)) {
    let place = match kind {
        Connector::Pty => live::Place::Pty(scratch("framed").to_str().expect("a path").into()),
        Connector::Uart => live::Place::Listen("127.0.0.1:0".into()),
    };
    let port = Port::open(&place, line).expect("a port");
    let place = match place {
        live::Place::Pty(link) => Place::Link(PathBuf::from(link)),
        _ => Place::Tcp(port.address().expect("an address")),
    };
    (port, (place, Arc::new(AtomicBool::new(kind == Connector::Pty))))
}
