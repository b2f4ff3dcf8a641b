//! Where the line's bytes come from and go to.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::Duration;

use puente_line::Settings;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::options::Place;
use crate::terminal::{self, Pty};

/// An open line. Only [`Port::read`] waits: bytes for which there is no room are lost, as on a wire.
pub enum Port {
    Pty(Pty),
    Device(File),
    Tcp { listener: TcpListener, client: Option<TcpStream> },
}

impl Port {
    /// Opens a line and names it, as in `tcp 127.0.0.1:5020`; the error is a whole sentence.
    pub fn open(place: &Place, line: Settings) -> Result<(Self, String), String> {
        match place {
            Place::Pty(link) => match Pty::open(link) {
                Ok(pty) => Ok((Self::Pty(pty), format!("pty {link}"))),
                Err(error) => Err(format!("cannot make the pseudo terminal {link}: {error}")),
            },
            Place::Device(path) => match terminal::open_device(path, line) {
                Ok(device) => Ok((Self::Device(device), format!("device {path}"))),
                Err(error) => Err(format!("cannot open the serial device {path}: {error}")),
            },
            Place::Listen(address) => {
                listen(address).map_err(|error| format!("cannot listen at {address}: {error}"))
            }
        }
    }

    /// Waits for bytes for at most `wait`, for ever without it; 0 when there were none.
    pub fn read(&mut self, buffer: &mut [u8], wait: Option<Duration>) -> io::Result<usize> {
        if !readable(self.fd(), wait)? {
            return Ok(0);
        }
        let (received, what) = match self {
            Self::Pty(pty) => (pty.master.read(buffer), "pseudo terminal"),
            Self::Device(device) => (device.read(buffer), "serial device"),
            Self::Tcp { listener, client } => {
                match client.as_mut().map(|client| client.read(buffer)) {
                    None => *client = accept(listener),
                    Some(Ok(count)) if count > 0 => return Ok(count),
                    Some(Err(error)) if error.kind() == ErrorKind::WouldBlock => {}
                    Some(_) => *client = None,
                }
                return Ok(0);
            }
        };
        match received {
            Ok(0) => Err(io::Error::other(format!("the {what} is gone"))),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
            received => received,
        }
    }

    /// Sends bytes; without a client they are lost.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Pty(pty) => write_what_fits(&mut pty.master, bytes),
            Self::Device(device) => write_what_fits(device, bytes),
            Self::Tcp { client, .. } => {
                if client.as_mut().is_some_and(|client| write_what_fits(client, bytes).is_err()) {
                    *client = None;
                }
                Ok(())
            }
        }
    }

    fn fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Pty(pty) => pty.master.as_fd(),
            Self::Device(device) => device.as_fd(),
            Self::Tcp { client: Some(client), .. } => client.as_fd(),
            Self::Tcp { listener, .. } => listener.as_fd(),
        }
    }
}

fn listen(address: &str) -> io::Result<(Port, String)> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let name = format!("tcp {}", listener.local_addr()?);
    Ok((Port::Tcp { listener, client: None }, name))
}

/// The next client; `None` where it has gone again.
fn accept(listener: &TcpListener) -> Option<TcpStream> {
    let (client, _) = listener.accept().ok()?;
    client.set_nonblocking(true).ok()?;
    client.set_nodelay(true).ok()?;
    Some(client)
}

fn readable(fd: BorrowedFd<'_>, wait: Option<Duration>) -> io::Result<bool> {
    let wait = wait.and_then(|wait| Timespec::try_from(wait).ok());
    match poll(&mut [PollFd::new(&fd, PollFlags::IN)], wait.as_ref()) {
        Ok(ready) => Ok(ready > 0),
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(error) => Err(error.into()),
    }
}

fn write_what_fits(to: &mut impl Write, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match to.write(bytes) {
            Ok(written) => bytes = bytes.get(written..).unwrap_or_default(),
            Err(error) if error.kind() == ErrorKind::WouldBlock => break,
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
