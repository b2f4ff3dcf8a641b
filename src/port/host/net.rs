//! OS sockets.

use std::future::pending;
use std::io::{self, Read as _, Write as _};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use async_io::Async;
use embassy_futures::select::{Either4, select4};
use embassy_time::{Timer, with_timeout};
use embedded_io_async::{ErrorType, Read, Write};
use rustix::net::sockopt;

use crate::port::{Door, Listener, Peer, Socket};

/// A peer that vanished is noticed after about 10 + 3 * 5 s of silence.
const KEEPALIVE_IDLE: Duration = Duration::from_secs(10);
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(5);
const KEEPALIVE_PROBES: u32 = 3;

/// A listening socket.
type Listening = Arc<Async<TcpListener>>;

/// The listening sockets.
#[derive(Clone)]
pub struct Doors {
    main: Listening,
    modbus: Listening,
    slcan: Option<Listening>,
    socketcand: Option<Listening>,
}

/// TCP ports to listen on.
#[derive(Clone, Copy, Debug)]
pub struct Ports {
    /// Of every dialect; 0 lets the system choose.
    pub main: u16,
    /// Of Modbus/TCP alone; 0 lets the system choose.
    pub modbus: u16,
    /// Of SLCAN; 0: there is none.
    pub slcan: u16,
    /// Of socketcand; 0: there is none.
    pub socketcand: u16,
}

impl Doors {
    /// Opens all of them.
    pub fn open(bind: Ipv4Addr, ports: Ports) -> io::Result<Self> {
        let open = |port| {
            Async::<TcpListener>::bind((bind, port)).map(Arc::new).map_err(|error| {
                io::Error::new(error.kind(), format!("cannot listen on {bind}:{port}: {error}"))
            })
        };
        let wanted = |port| Some(port).filter(|port| *port != 0).map(open).transpose();
        Ok(Self {
            main: open(ports.main)?,
            modbus: open(ports.modbus)?,
            slcan: wanted(ports.slcan)?,
            socketcand: wanted(ports.socketcand)?,
        })
    }

    /// The next client, if no other place takes it.
    ///
    /// It is not taken before the system has told of it: thereby those who have gone are noticed as soon as those who come.
    /// Otherwise a fast succession of clients is taken for a crowd while the thread is late that hears from the system.
    async fn next(&self) -> io::Result<Option<HostSocket>> {
        let knocks = select4(
            self.main.readable(),
            self.modbus.readable(),
            readable(self.slcan.as_ref()),
            readable(self.socketcand.as_ref()),
        );
        let (told, door, listener) = match knocks.await {
            Either4::First(told) => (told, Door::Main, Some(&self.main)),
            Either4::Second(told) => (told, Door::Modbus, Some(&self.modbus)),
            Either4::Third(told) => (told, Door::Slcan, self.slcan.as_ref()),
            Either4::Fourth(told) => (told, Door::Socketcand, self.socketcand.as_ref()),
        };
        told?;
        let Some(listener) = listener else { return Ok(None) };
        let (stream, from) = match listener.get_ref().accept() {
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(None),
            accepted => accepted?,
        };
        HostSocket::new(Async::new(stream)?, from, door).map(Some)
    }

    /// Where they listen: what each is called, and its address.
    pub fn addresses(&self) -> impl Iterator<Item = (&'static str, io::Result<SocketAddr>)> {
        let doors = [
            ("http", Some(&self.main)),
            ("modbus-tcp", Some(&self.modbus)),
            ("slcan", self.slcan.as_ref()),
            ("socketcand", self.socketcand.as_ref()),
        ];
        doors.into_iter().filter_map(|(name, door)| Some((name, door?.get_ref().local_addr())))
    }
}

/// Resolves when somebody knocks; where there is no door, never.
async fn readable(door: Option<&Listening>) -> io::Result<()> {
    match door {
        Some(door) => door.readable().await,
        None => pending().await,
    }
}

/// One place for a client; all places share the doors.
pub struct Place(pub Doors);

impl Listener for Place {
    type Socket<'a> = HostSocket;

    async fn accept(&mut self) -> HostSocket {
        loop {
            match self.0.next().await {
                Ok(Some(socket)) => return socket,
                Ok(None) => {}
                Err(error) => {
                    // Out of file descriptors, or a client that is gone already.
                    log::warn!("cannot accept a client: {error}");
                    Timer::after_millis(100).await;
                }
            }
        }
    }
}

/// One connection.
pub struct HostSocket {
    stream: Async<TcpStream>,
    peer: Peer,
    door: Door,
}

impl HostSocket {
    fn new(stream: Async<TcpStream>, from: SocketAddr, door: Door) -> io::Result<Self> {
        stream.get_ref().set_nodelay(true)?;
        sockopt::set_socket_keepalive(&stream, true)?;
        sockopt::set_tcp_keepidle(&stream, KEEPALIVE_IDLE)?;
        sockopt::set_tcp_keepintvl(&stream, KEEPALIVE_INTERVAL)?;
        sockopt::set_tcp_keepcnt(&stream, KEEPALIVE_PROBES)?;
        let ip = match from {
            SocketAddr::V4(address) => address.ip().octets(),
            SocketAddr::V6(_) => [0; 4],
        };
        Ok(Self { stream, peer: Peer { ip, port: from.port() }, door })
    }
}

impl Socket for HostSocket {
    type Error = io::Error;
    type Reader<'a> = HostReader<'a>;
    type Writer<'a> = HostWriter<'a>;

    fn peer(&self) -> Peer {
        self.peer
    }

    fn door(&self) -> Door {
        self.door
    }

    fn split(&mut self) -> (HostReader<'_>, HostWriter<'_>) {
        (HostReader(&self.stream), HostWriter(&self.stream))
    }

    async fn close(&mut self) {
        let _ = self.stream.get_ref().shutdown(Shutdown::Write);
        // Closing with unread bytes would send RST, which can overtake the last reply.
        let drain = async {
            let mut rest = [0; 1024];
            while matches!(HostReader(&self.stream).read(&mut rest).await, Ok(count) if count > 0) {}
        };
        let _ = with_timeout(embassy_time::Duration::from_millis(500), drain).await;
    }

    fn abort(&mut self) {
        let _ = sockopt::set_socket_linger(&self.stream, Some(Duration::ZERO));
        let _ = self.stream.get_ref().shutdown(Shutdown::Both);
    }
}

/// The receiving half.
pub struct HostReader<'a>(&'a Async<TcpStream>);
/// The sending half.
pub struct HostWriter<'a>(&'a Async<TcpStream>);

impl ErrorType for HostReader<'_> {
    type Error = io::Error;
}

impl Read for HostReader<'_> {
    async fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read_with(|mut stream| stream.read(buffer)).await
    }
}

impl ErrorType for HostWriter<'_> {
    type Error = io::Error;
}

impl Write for HostWriter<'_> {
    async fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write_with(|mut stream| stream.write(bytes)).await
    }

    async fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
