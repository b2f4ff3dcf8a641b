//! A CAN cell in real time, with any number of clients, each of which has a seat on the bus: SLCAN adapters over TCP and
//! pseudo terminals, and a socketcand.

mod capture;
mod client;
mod slcan;
mod socketcand;

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

pub use capture::Capture;
use client::{Client, Stream};
use puente_line::Instant;
pub use slcan::{flags, states};

use super::terminal::Pty;
use super::wait;
use crate::can::Cell;
use crate::can::bus::Event;

/// Clients at the same time; more are turned away.
pub const CLIENTS: usize = 32;
/// Frames that a client may have on the way to the bus: an SLCAN adapter refuses more, a socketcand leaves them in the socket.
/// Several blocks of an SDO, for there are clients that do not look whether they are refused.
const AHEAD: usize = 512;
/// A frame takes less than the system needs to wait for it: what is heard is late by so much at most.
const REST: Duration = Duration::from_micros(100);

/// Where clients come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Door {
    /// SLCAN over TCP.
    Slcan(String),
    /// SLCAN on a pseudo terminal, with a symbolic link of this name to it.
    Pty(String),
    /// socketcand.
    Socketcand(String),
}

/// What is spoken at a door.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Speech {
    Slcan,
    Socketcand,
}

struct Listener {
    listener: TcpListener,
    speech: Speech,
    address: SocketAddr,
}

/// The clients of a cell, and the clock that it goes by. The cell has [`CLIENTS`] ports.
pub struct Hub {
    listeners: Vec<Listener>,
    /// By their ports.
    clients: Vec<Option<Client>>,
    /// Names of the doors, as in `slcan 127.0.0.1:29000`.
    names: Vec<String>,
    start: std::time::Instant,
}

impl Hub {
    /// Opens the doors; the clock starts now. The error is a sentence.
    ///
    /// # Errors
    /// A door that cannot be opened.
    pub fn open(cell: &mut Cell, doors: &[Door]) -> Result<Self, String> {
        let clients = std::iter::repeat_with(|| None).take(CLIENTS).collect();
        let start = std::time::Instant::now();
        let mut hub = Self { listeners: Vec::new(), clients, names: Vec::new(), start };
        for port in 0..CLIENTS {
            cell.bus().set_present(port, false);
        }
        for door in doors {
            hub.open_door(cell, door)?;
        }
        Ok(hub)
    }

    fn open_door(&mut self, cell: &mut Cell, door: &Door) -> Result<(), String> {
        let (speech, word, address) = match door {
            Door::Pty(link) => {
                let pty = Pty::open(link)
                    .map_err(|error| format!("cannot make the pseudo terminal {link}: {error}"))?;
                self.names.push(format!("pty {link}"));
                self.take(cell, Stream::Pty(pty), Speech::Slcan);
                return Ok(());
            }
            Door::Slcan(address) => (Speech::Slcan, "slcan", address),
            Door::Socketcand(address) => (Speech::Socketcand, "socketcand", address),
        };
        let listener = listen(address).map_err(|error| format!("cannot listen at {address}: {error}"))?;
        let address = listener.local_addr().map_err(|error| error.to_string())?;
        self.names.push(format!("{word} {address}"));
        self.listeners.push(Listener { listener, speech, address });
        Ok(())
    }

    /// What the doors are and where, as in `slcan 127.0.0.1:29000`.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Where TCP clients come to, in the order of the doors.
    pub fn addresses(&self) -> impl Iterator<Item = SocketAddr> {
        self.listeners.iter().map(|listener| listener.address)
    }

    /// The time.
    pub fn now(&self) -> Instant {
        Instant::from_micros(self.start.elapsed().as_micros() as u64)
    }

    /// Carries what clients have said to the cell, and what has been on the bus to the clients; gives what has been there.
    ///
    /// # Errors
    /// A pseudo terminal that fails.
    pub fn carry(&mut self, cell: &mut Cell) -> io::Result<Vec<Event>> {
        self.accept(cell);
        for port in 0..self.clients.len() {
            let now = self.now();
            let Some(client) = &mut self.clients[port] else { continue };
            let there = client.receive(cell, port, now)?;
            if !there {
                self.clients[port] = None;
                cell.bus().set_present(port, false);
            }
        }
        let now = self.now();
        cell.run(now);
        for (port, client) in self.clients.iter_mut().enumerate() {
            let Some(open) = client else { continue };
            while let Some(heard) = cell.hear(now, port) {
                open.tell(&heard);
            }
            open.look(cell.counters(port));
            if !open.flush() {
                *client = None;
                cell.bus().set_present(port, false);
            }
        }
        Ok(cell.take_events().collect())
    }

    fn accept(&mut self, cell: &mut Cell) {
        let mut come = Vec::new();
        for door in &self.listeners {
            while let Ok((stream, _)) = door.listener.accept() {
                if stream.set_nonblocking(true).is_ok() && stream.set_nodelay(true).is_ok() {
                    come.push((stream, door.speech));
                }
            }
        }
        for (stream, speech) in come {
            self.take(cell, Stream::Tcp(stream), speech);
        }
    }

    /// Gives a client a seat; without one it is turned away.
    fn take(&mut self, cell: &mut Cell, stream: Stream, speech: Speech) {
        if let Some(port) = self.clients.iter().position(Option::is_none) {
            self.clients[port] = Some(Client::new(stream, speech));
            cell.bus().set_present(port, true);
            // What it had not taken is not for the next one.
            while cell.bus().take(port).is_some() {}
        }
    }

    /// Waits until somebody says something, or until `at`, when the cell has to be polled.
    ///
    /// # Errors
    /// That of the system.
    pub fn wait(&self, at: Option<Instant>) -> io::Result<()> {
        let most = at.map(|at| at.since(self.now()).max(REST));
        let doors = self.listeners.iter().map(|door| door.listener.as_fd());
        let clients = self.clients.iter().flatten().filter(|client| client.listens());
        let fds: Vec<BorrowedFd<'_>> = doors.chain(clients.map(AsFd::as_fd)).collect();
        wait(fds, most)
    }
}

fn listen(address: &str) -> io::Result<TcpListener> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}
