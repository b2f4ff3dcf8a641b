//! Places for TCP clients.

use embassy_futures::select::{Either, select};
use embassy_net::tcp::{self, State, TcpReader, TcpSocket, TcpWriter};
use embassy_net::{IpAddress, Stack};
use embassy_time::{Duration, with_timeout};
use static_cell::ConstStaticCell;

use super::backlog;
use super::doors::Post;
use crate::port::embedded::limits::SLOTS;
use crate::port::{self, Door, Peer};

/// A peer is asked for a sign of life after this silence,
const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// and given up after this one. Motion does not wait for it: the commander's lease is much shorter.
const TIMEOUT: Duration = Duration::from_secs(15);
/// How long a closing connection may take to deliver its last bytes.
const LINGER: Duration = Duration::from_millis(1_000);

/// Window of a client: two Modbus/TCP frames of 260 bytes, or the longest Modbus ASCII frame.
const RECEIVE: usize = 640;
/// Most replies in one; what is longer goes out segment by segment.
const SEND: usize = 1024;

/// One place for a client.
pub struct Place {
    socket: TcpSocket<'static>,
    ports: Ports,
    post: Post,
}

/// The TCP ports of the two doors.
#[derive(Clone, Copy)]
pub(in crate::port) struct Ports {
    pub main: u16,
    pub modbus: u16,
}

/// Opens all places. Call it once.
pub(in crate::port) fn places(stack: Stack<'static>, ports: Ports) -> [Place; SLOTS] {
    type Buffers = [([u8; RECEIVE], [u8; SEND]); SLOTS];
    static BUFFERS: ConstStaticCell<Buffers> = ConstStaticCell::new([([0; RECEIVE], [0; SEND]); SLOTS]);
    backlog::open(ports);
    BUFFERS.take().each_mut().map(|(receive, send)| {
        let mut socket = TcpSocket::new(stack, receive, send);
        socket.set_keep_alive(Some(KEEP_ALIVE));
        socket.set_timeout(Some(TIMEOUT));
        // Answers are small and wanted at once.
        socket.set_nagle_enabled(false);
        Place { socket, ports, post: Post::new().expect("there are SLOTS of them") }
    })
}

impl Place {
    /// Waits for a client at the door where this place is posted; the door where it came, if it did.
    async fn listen(&mut self) -> Option<Door> {
        loop {
            let door = self.post.take();
            let port = match door {
                Door::Main => self.ports.main,
                _ => self.ports.modbus,
            };
            match select(self.socket.accept(port), self.post.changed()).await {
                Either::First(accepted) => return accepted.ok().map(|()| door),
                // Somebody has knocked: this place is not free to go.
                Either::Second(()) if self.socket.state() != State::Listen => {
                    return self.established().await.map(|()| door);
                }
                Either::Second(()) if self.post.moves() => self.socket.abort(),
                Either::Second(()) => {}
            }
        }
    }

    /// Sees a handshake through.
    async fn established(&mut self) -> Option<()> {
        let _ = with_timeout(LINGER, self.socket.wait_write_ready()).await;
        matches!(self.socket.state(), State::Established | State::CloseWait).then_some(())
    }

    /// Clears what the last client left: its RST has to go out before the socket can listen again.
    async fn clear(&mut self) {
        if self.socket.state() != State::Closed {
            self.socket.abort();
        }
        // Nobody hears it where the link is down.
        let _ = with_timeout(LINGER, self.socket.flush()).await;
    }
}

impl port::Listener for Place {
    type Socket<'a> = Socket<'a>;

    async fn accept(&mut self) -> Socket<'_> {
        loop {
            self.clear().await;
            if let Some(door) = self.listen().await
                && let Some(peer) = peer(&self.socket)
            {
                self.post.leave();
                return Socket { socket: &mut self.socket, peer, door };
            }
        }
    }
}

fn peer(socket: &TcpSocket<'_>) -> Option<Peer> {
    let remote = socket.remote_endpoint()?;
    let IpAddress::Ipv4(ip) = remote.addr;
    Some(Peer { ip: ip.octets(), port: remote.port })
}

/// An accepted connection.
pub struct Socket<'a> {
    socket: &'a mut TcpSocket<'static>,
    peer: Peer,
    door: Door,
}

impl port::Socket for Socket<'_> {
    type Error = tcp::Error;
    type Reader<'b>
        = TcpReader<'b>
    where
        Self: 'b;
    type Writer<'b>
        = TcpWriter<'b>
    where
        Self: 'b;

    fn peer(&self) -> Peer {
        self.peer
    }

    fn door(&self) -> Door {
        self.door
    }

    fn split(&mut self) -> (TcpReader<'_>, TcpWriter<'_>) {
        self.socket.split()
    }

    /// Sends FIN and waits for the client's, at most [`LINGER`]: an early reset would make its stack throw away the
    /// answer that it has not read yet.
    async fn close(&mut self) {
        self.socket.close();
        let farewell = async {
            self.socket.flush().await?;
            let mut late = [0; 64];
            while self.socket.read(&mut late).await? > 0 {}
            Ok::<(), tcp::Error>(())
        };
        if !matches!(with_timeout(LINGER, farewell).await, Ok(Ok(()))) {
            self.socket.abort();
        }
    }

    fn abort(&mut self) {
        self.socket.abort();
    }
}
