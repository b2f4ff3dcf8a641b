//! Clients that all end their connection and make a new one at the same moment.

use std::time::Duration;

use smoltcp::iface::SocketHandle;
use smoltcp::socket::tcp::State;

use crate::common::client::mbap;
use crate::common::ethernet::Host;
use crate::{LEASED, beside};

const CLIENTS: usize = 8;
const ROUNDS: usize = 60;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Manner {
    Modbus,
    Http,
    Console,
}

impl Manner {
    fn port(self) -> u16 {
        if self == Manner::Modbus { 502 } else { 80 }
    }

    fn request(self) -> Vec<u8> {
        match self {
            // There is no function 0.
            Manner::Modbus => mbap(1, 1, &[0, 0]),
            Manner::Http => b"GET /nothing HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n".to_vec(),
            Manner::Console => b"feed\r\n".to_vec(),
        }
    }

    fn is_answered(self, reply: &[u8]) -> bool {
        match self {
            Manner::Modbus => reply == mbap(1, 1, &[0x80, 1]),
            Manner::Http => reply.starts_with(b"HTTP/1.1 404 ") && reply.ends_with(b"}"),
            Manner::Console => reply == b"ok\r\n",
        }
    }
}

struct Client {
    manner: Manner,
    /// One for this connection, one for the last, which is still ending.
    sockets: [SocketHandle; 2],
    sent: bool,
    reply: Vec<u8>,
}

impl Client {
    fn new(host: &mut Host, manner: Manner) -> Self {
        let sockets = [host.socket(), host.socket()];
        Self { manner, sockets, sent: false, reply: Vec::new() }
    }

    fn begin(&mut self, host: &mut Host) {
        self.sockets.swap(0, 1);
        (self.sent, self.reply) = (false, Vec::new());
        host.reconnect(self.sockets[0], (LEASED, self.manner.port()));
    }

    /// Whether it has its answer.
    fn step(&mut self, host: &mut Host) -> bool {
        let manner = self.manner;
        let socket = host.tcp(self.sockets[0]);
        assert!(socket.state() != State::Closed, "{manner:?}: refused or reset, having got {:?}", self.reply);
        if !self.sent && socket.can_send() {
            self.sent = socket.send_slice(&manner.request()).is_ok();
        }
        let _ = socket.recv(|bytes| {
            self.reply.extend_from_slice(bytes);
            (bytes.len(), ())
        });
        manner.is_answered(&self.reply)
    }
}

/// All SYNs of a round are on the wire before the board can look, together with the FINs of the round before.
fn all_at_once(host: &mut Host, manners: [Manner; CLIENTS]) {
    let mut clients = manners.map(|manner| Client::new(host, manner));
    for round in 0..ROUNDS {
        for client in &mut clients {
            host.tcp(client.sockets[0]).close();
            client.begin(host);
        }
        let mut answered = [false; CLIENTS];
        let all = host.lives(Duration::from_secs(20), |host| {
            for (client, answered) in clients.iter_mut().zip(&mut answered) {
                *answered = *answered || client.step(host);
            }
            answered.iter().all(|answered| *answered)
        });
        assert!(all, "round {round} of {manners:?}: {answered:?}");
    }
    for client in clients {
        host.tcp(client.sockets[0]).close();
    }
}

#[test]
fn clients_that_reconnect_at_the_same_moment_are_never_refused() {
    use Manner::{Console, Http, Modbus};
    let (_rig, mut host, _) = beside([10, 0, 2, 77]);
    let three = [Modbus, Http, Console].map(|manner| [manner; CLIENTS]);
    let mixed = [
        [Modbus, Http, Modbus, Console, Modbus, Http, Modbus, Console],
        [Modbus, Http, Console, Http, Console, Http, Console, Http],
        [Modbus, Modbus, Modbus, Modbus, Modbus, Modbus, Http, Console],
    ];
    for manners in three.into_iter().chain(mixed).chain(three) {
        all_at_once(&mut host, manners);
    }
}
