//! Where a station's bytes come from and go to.

use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};

use puente_line::Settings;

use super::terminal::{self, Pty};
use super::{Received, received};

/// Where a port is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A pseudo terminal, with a symbolic link of this name to it.
    Pty(String),
    /// Raw bytes over TCP, one client at a time.
    Listen(String),
    /// A serial device.
    Device(String),
}

/// An open port. Nothing here waits: bytes for which there is no room are lost, as on a wire.
pub struct Port(End);

enum End {
    Pty(Pty),
    Device(File, String),
    Tcp { listener: TcpListener, address: SocketAddr, client: Option<TcpStream> },
}

impl Port {
    /// Opens a port; the error is a whole sentence.
    pub fn open(place: &Place, line: Settings) -> Result<Self, String> {
        let end = match place {
            Place::Pty(link) => Pty::open(link)
                .map(End::Pty)
                .map_err(|error| (format!("make the pseudo terminal {link}"), error)),
            Place::Device(path) => terminal::open_device(path, line)
                .map(|device| End::Device(device, path.clone()))
                .map_err(|error| (format!("open the serial device {path}"), error)),
            Place::Listen(address) => {
                listen(address).map_err(|error| (format!("listen at {address}"), error))
            }
        };
        end.map(Self).map_err(|(what, error)| format!("cannot {what}: {error}"))
    }

    /// What kind of port it is and where, as in `tcp 127.0.0.1:5020`.
    pub fn name(&self) -> String {
        match &self.0 {
            End::Pty(pty) => format!("pty {}", pty.link),
            End::Device(_, path) => format!("device {path}"),
            End::Tcp { address, .. } => format!("tcp {address}"),
        }
    }

    /// Where TCP clients come to, if they do.
    pub fn address(&self) -> Option<SocketAddr> {
        match &self.0 {
            End::Tcp { address, .. } => Some(*address),
            End::Pty(_) | End::Device(..) => None,
        }
    }

    /// Appends what has come to `buffer`.
    pub fn receive(&mut self, buffer: &mut Vec<u8>) -> io::Result<Received> {
        let mut bytes = [0; 4_096];
        let count = match &mut self.0 {
            End::Pty(pty) => return pty.receive(buffer),
            End::Device(device, _) => received(device.read(&mut bytes), "serial device")?,
            End::Tcp { listener, client, .. } => {
                let Some(stream) = client else {
                    *client = accept(listener);
                    return Ok(if client.is_some() { Received::Bytes } else { Received::Nothing });
                };
                match received(stream.read(&mut bytes), "client") {
                    Ok(count) => count,
                    Err(_) => {
                        // The next one takes its place.
                        *client = None;
                        return Ok(Received::Bytes);
                    }
                }
            }
        };
        buffer.extend_from_slice(bytes.get(..count).unwrap_or_default());
        Ok(if count > 0 { Received::Bytes } else { Received::Nothing })
    }

    /// Sends bytes; without a client they are lost.
    pub fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match &mut self.0 {
            End::Pty(pty) => write_what_fits(&mut pty.master, bytes),
            End::Device(device, _) => write_what_fits(device, bytes),
            End::Tcp { client, .. } => {
                if client.as_mut().is_some_and(|client| write_what_fits(client, bytes).is_err()) {
                    *client = None;
                }
                Ok(())
            }
        }
    }
}

impl AsFd for Port {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match &self.0 {
            End::Pty(pty) => pty.master.as_fd(),
            End::Device(device, _) => device.as_fd(),
            End::Tcp { client: Some(client), .. } => client.as_fd(),
            End::Tcp { listener, .. } => listener.as_fd(),
        }
    }
}

fn listen(address: &str) -> io::Result<End> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    Ok(End::Tcp { listener, address, client: None })
}

/// The next client; `None` where it has gone again.
fn accept(listener: &TcpListener) -> Option<TcpStream> {
    let (client, _) = listener.accept().ok()?;
    client.set_nonblocking(true).ok()?;
    client.set_nodelay(true).ok()?;
    Some(client)
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
