//! Places for TCP clients.

use embassy_net::tcp::{self, State, TcpReader, TcpSocket, TcpWriter};
use embassy_net::{IpAddress, Stack};
use embassy_time::{Duration, with_timeout};
use static_cell::ConstStaticCell;

use super::limits::{MAIN_SLOTS, MODBUS_SLOTS, SLOTS};
use crate::port::{self, Door, Peer};

/// A peer is asked for a sign of life after this silence,
const KEEP_ALIVE: Duration = Duration::from_secs(5);
/// and given up after this one. Motion does not wait for it: the commander's lease is much shorter.
const TIMEOUT: Duration = Duration::from_secs(15);
/// How long a closing connection may take to deliver its last bytes.
const LINGER: Duration = Duration::from_millis(1_000);

/// Window of a client on the main port: a request, or a page's worth of pipelined frames.
const MAIN_RECEIVE: usize = 1024;
/// Two full segments, so that a client that acknowledges every second one does not keep us waiting.
const MAIN_SEND: usize = 2 * 1460;
/// Two Modbus/TCP frames of 260 bytes in each direction.
const MODBUS_BUFFER: usize = 520;

/// One place for a client.
pub struct Place {
    socket: TcpSocket<'static>,
    tcp_port: u16,
    door: Door,
}

/// Opens all places. Call it once.
pub(super) fn places(stack: Stack<'static>, main: u16, modbus: u16) -> [Place; SLOTS] {
    type Buffers<const N: usize, const RECEIVE: usize, const SEND: usize> = [([u8; RECEIVE], [u8; SEND]); N];
    static MAIN: ConstStaticCell<Buffers<MAIN_SLOTS, MAIN_RECEIVE, MAIN_SEND>> =
        ConstStaticCell::new([([0; MAIN_RECEIVE], [0; MAIN_SEND]); MAIN_SLOTS]);
    static MODBUS: ConstStaticCell<Buffers<MODBUS_SLOTS, MODBUS_BUFFER, MODBUS_BUFFER>> =
        ConstStaticCell::new([([0; MODBUS_BUFFER], [0; MODBUS_BUFFER]); MODBUS_SLOTS]);

    let main =
        MAIN.take().iter_mut().map(|(receive, send)| Place::new(stack, receive, send, main, Door::Main));
    let modbus = MODBUS
        .take()
        .iter_mut()
        .map(|(receive, send)| Place::new(stack, receive, send, modbus, Door::Modbus));
    let mut all = main.chain(modbus);
    core::array::from_fn(|_| all.next().expect("SLOTS is the sum of both"))
}

impl Place {
    fn new(
        stack: Stack<'static>,
        receive: &'static mut [u8],
        send: &'static mut [u8],
        tcp_port: u16,
        door: Door,
    ) -> Self {
        let mut socket = TcpSocket::new(stack, receive, send);
        socket.set_keep_alive(Some(KEEP_ALIVE));
        socket.set_timeout(Some(TIMEOUT));
        // Answers are small and wanted at once.
        socket.set_nagle_enabled(false);
        Self { socket, tcp_port, door }
    }
}

impl port::Listener for Place {
    type Socket<'a> = Socket<'a>;

    async fn accept(&mut self) -> Socket<'_> {
        loop {
            // What the last client left: the RST has to go out before the socket can listen again.
            if self.socket.state() != State::Closed {
                self.socket.abort();
            }
            let _ = with_timeout(LINGER, self.socket.flush()).await;
            if self.socket.accept(self.tcp_port).await.is_ok()
                && let Some(peer) = peer(&self.socket)
            {
                return Socket { socket: &mut self.socket, peer, door: self.door };
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
