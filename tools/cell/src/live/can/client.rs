//! A client: its bytes, and what it speaks.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::os::fd::{AsFd, BorrowedFd};

use puente_line::Instant;

use super::super::Received;
use super::super::terminal::Pty;
use super::slcan::Slcan;
use super::socketcand::Socketcand;
use super::{AHEAD, Speech};
use crate::can::Cell;
use crate::can::bus::{Counters, Heard};

/// Bytes that a client may be behind; who reads less is let go.
const BEHIND: usize = 1 << 20;

/// Its end.
pub enum Stream {
    Tcp(TcpStream),
    Pty(Pty),
}

enum Tongue {
    Slcan(Slcan),
    Socketcand(Socketcand),
}

/// A client on a seat of the bus.
pub struct Client {
    stream: Stream,
    tongue: Tongue,
    /// Said, and not yet sent.
    outbox: Vec<u8>,
    /// Its bytes are not read while it has enough frames under way.
    full: bool,
}

impl Client {
    pub fn new(stream: Stream, speech: Speech) -> Self {
        let mut outbox = Vec::new();
        let tongue = match speech {
            Speech::Slcan => Tongue::Slcan(Slcan::default()),
            Speech::Socketcand => Tongue::Socketcand(Socketcand::new(&mut outbox)),
        };
        Self { stream, tongue, outbox, full: false }
    }

    /// Whether it is worth waiting for its bytes.
    pub fn listens(&self) -> bool {
        !self.full
    }

    /// Takes what it has said; false when it is gone.
    pub fn receive(&mut self, cell: &mut Cell, port: usize, now: Instant) -> io::Result<bool> {
        loop {
            self.full = matches!(self.tongue, Tongue::Socketcand(_)) && cell.pending(port) >= AHEAD;
            if self.full {
                return Ok(true);
            }
            let mut bytes = Vec::new();
            match &mut self.stream {
                Stream::Pty(pty) => match pty.receive(&mut bytes)? {
                    Received::Nothing => return Ok(true),
                    Received::Discard => cell.discard(port),
                    Received::Bytes => {}
                },
                Stream::Tcp(stream) => {
                    let mut buffer = [0; 4_096];
                    match stream.read(&mut buffer) {
                        Ok(0) => return Ok(false),
                        Ok(count) => bytes.extend_from_slice(buffer.get(..count).unwrap_or_default()),
                        Err(error) if is_idle(&error) => return Ok(true),
                        Err(_) => return Ok(false),
                    }
                }
            }
            for byte in bytes {
                match &mut self.tongue {
                    Tongue::Slcan(slcan) => slcan.take(byte, cell, port, now, &mut self.outbox),
                    Tongue::Socketcand(server) => server.take(byte, cell, port, now, &mut self.outbox),
                }
            }
        }
    }

    /// A frame has been on the bus.
    pub fn tell(&mut self, heard: &Heard) {
        match &mut self.tongue {
            Tongue::Slcan(slcan) => slcan.tell(heard, &mut self.outbox),
            Tongue::Socketcand(server) => server.tell(heard, &mut self.outbox),
        }
    }

    /// Its controller is like this.
    pub fn look(&mut self, counters: Counters) {
        if let Tongue::Slcan(slcan) = &mut self.tongue {
            slcan.look(counters, &mut self.outbox);
        }
    }

    /// Sends what it is told; false when it is gone, or far too slow.
    pub fn flush(&mut self) -> bool {
        while !self.outbox.is_empty() {
            let written = match &mut self.stream {
                Stream::Tcp(stream) => stream.write(&self.outbox),
                Stream::Pty(pty) => pty.master.write(&self.outbox),
            };
            match written {
                Ok(count) => drop(self.outbox.drain(..count)),
                Err(error) if is_idle(&error) => break,
                Err(_) => return matches!(self.stream, Stream::Pty(_)),
            }
        }
        if matches!(self.stream, Stream::Pty(_)) && self.outbox.len() > BEHIND {
            // Nobody has the far side open: as on a wire, it is lost.
            self.outbox.clear();
        }
        self.outbox.len() <= BEHIND
    }
}

fn is_idle(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
}

impl AsFd for Client {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match &self.stream {
            Stream::Tcp(stream) => stream.as_fd(),
            Stream::Pty(pty) => pty.master.as_fd(),
        }
    }
}
