//! A framed cell on its ports.

use std::io;
use std::os::fd::AsFd;
use std::time::Duration;

use puente_line::Instant;

use super::{Port, Received, wait};
use crate::framed::Cell;

/// The ports of a framed cell, and the clock that it goes by.
pub struct Ports {
    ports: Vec<Port>,
    connected: Vec<bool>,
    rest: Duration,
    start: std::time::Instant,
    buffer: Vec<u8>,
}

impl Ports {
    /// One for each port of the cell, whose clock starts now. Unless something comes they rest for so long, for a character may
    /// take less than the system to wait for it: what is heard is late by so much at most.
    pub fn new(ports: Vec<Port>, rest: Duration) -> Self {
        let connected = vec![true; ports.len()];
        Self { ports, connected, rest, start: std::time::Instant::now(), buffer: Vec::new() }
    }

    /// The time.
    pub fn now(&self) -> Instant {
        Instant::from_micros(self.start.elapsed().as_micros() as u64)
    }

    /// Takes a port from the line, or puts it there again. While it is not there, what comes and goes is lost.
    pub fn connect(&mut self, port: usize, connected: bool) {
        self.connected[port] = connected;
    }

    /// Carries what has come from the ports to the cell, and what has been on the line to the ports.
    pub fn carry(&mut self, cell: &mut Cell) -> io::Result<()> {
        for at in 0..self.ports.len() {
            loop {
                let received = self.ports[at].receive(&mut self.buffer)?;
                let now = self.now();
                if self.connected[at] && !self.buffer.is_empty() {
                    cell.receive(at, now, &self.buffer);
                }
                self.buffer.clear();
                match received {
                    Received::Bytes => {}
                    Received::Discard => cell.discard(at, now),
                    Received::Nothing => break,
                }
            }
        }
        let now = self.now();
        for (at, port) in self.ports.iter_mut().enumerate() {
            if let Some(bytes) = cell.poll(at, now).filter(|_| self.connected[at]) {
                port.write(&bytes)?;
            }
        }
        Ok(())
    }

    /// Waits until something comes, or until `at`, when the cell has to be polled.
    pub fn wait(&self, at: Option<Instant>) -> io::Result<()> {
        let most = at.map(|at| at.since(self.now()).max(self.rest));
        wait(self.ports.iter().map(AsFd::as_fd), most)
    }
}
