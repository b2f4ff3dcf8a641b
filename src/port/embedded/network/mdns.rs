//! The board's name on the network: mDNS over UDP. What is said is in the crate `puente_mdns`.

use embassy_net::udp::{PacketMetadata, UdpSocket};
use embassy_net::{IpAddress, IpEndpoint, Stack};
use embassy_time::{Duration, Instant, Timer, with_timeout};
use puente_mdns::{Answer, GROUP, HOP_LIMIT, Host, LONGEST, PORT, Service, To};
use static_cell::{ConstStaticCell, StaticCell};

use super::socket::Ports;

/// Bytes of the longest question that is heard.
const QUESTION: usize = 1024;
/// How long after the first announcement the second one follows (RFC 6762, clause 8.3).
const AGAIN: Duration = Duration::from_secs(1);
/// How long an answer may take to go out: an asker that does not exist must not hold up the others.
const SENT: Duration = Duration::from_millis(500);

pub(super) struct Responder {
    stack: Stack<'static>,
    socket: UdpSocket<'static>,
    services: [Service; 2],
}

impl Responder {
    /// Opens the socket. Call it once.
    pub(super) fn start(stack: Stack<'static>, ports: Ports) -> Self {
        static BUFFERS: ConstStaticCell<([u8; QUESTION], [u8; LONGEST])> =
            ConstStaticCell::new(([0; QUESTION], [0; LONGEST]));
        static PACKETS: StaticCell<([PacketMetadata; 4], [PacketMetadata; 1])> = StaticCell::new();
        let (questions, answers) = BUFFERS.take();
        let (asked, answered) = PACKETS.init(([PacketMetadata::EMPTY; 4], [PacketMetadata::EMPTY; 1]));
        let mut socket = UdpSocket::new(stack, asked, questions, answered, answers);
        socket.set_hop_limit(Some(HOP_LIMIT));
        let services =
            [Service { name: "_http", port: ports.main }, Service { name: "_modbus", port: ports.modbus }];
        Self { stack, socket, services }
    }

    /// Announces the board twice, and answers questions, for ever.
    pub(super) async fn run(&mut self, name: &str) {
        // Without a place in the table of groups nobody would hear us: there are more than this one.
        let _ = self.stack.join_multicast_group(GROUP);
        self.open();
        self.announce(name).await;
        let _ = with_timeout(AGAIN, self.answer_all(name)).await;
        self.announce(name).await;
        self.answer_all(name).await
    }

    /// Opens the socket anew, and forgets what waits in it.
    fn open(&mut self) {
        self.socket.close();
        // Refused only for port 0, and for a socket that is open.
        let _ = self.socket.bind(PORT);
    }

    async fn announce(&mut self, name: &str) {
        let bytes = self.host(name).and_then(|host| host.announcement());
        if let Some(bytes) = bytes {
            self.send(&bytes, GROUP.into(), PORT).await;
        }
    }

    async fn answer_all(&mut self, name: &str) -> ! {
        loop {
            self.socket.wait_recv_ready().await;
            let Some((answer, asker)) = self.next(name).await else { continue };
            let (to, port) = match answer.to {
                To::Group { .. } => (GROUP.into(), PORT),
                To::Asker => (asker.addr, asker.port),
            };
            if let To::Group { shared: true } = answer.to {
                Timer::after(pause()).await;
            }
            self.send(&answer.bytes, to, port).await;
        }
    }

    /// Takes the next message, and says what is to be answered to whom.
    async fn next(&mut self, name: &str) -> Option<(Answer, IpEndpoint)> {
        let network = self.stack.config_v4().map(|config| config.address);
        let services = self.services;
        self.socket
            .recv_from_with(|message, from| {
                let network = network?;
                let IpAddress::Ipv4(asker) = from.endpoint.addr;
                // Whoever is not on this network has no business here (clause 11).
                if !network.contains_addr(&asker) {
                    return None;
                }
                let host = Host { name, address: network.address(), services: &services };
                Some((host.answer(message, from.endpoint.port)?, from.endpoint))
            })
            .await
    }

    fn host<'a>(&'a self, name: &'a str) -> Option<Host<'a>> {
        let config = self.stack.config_v4()?;
        Some(Host { name, address: config.address.address(), services: &self.services })
    }

    async fn send(&mut self, bytes: &[u8], to: IpAddress, port: u16) {
        let sent = async {
            // What cannot be sent is asked for again.
            let _ = self.socket.send_to(bytes, IpEndpoint::new(to, port)).await;
            self.socket.flush().await;
        };
        if with_timeout(SENT, sent).await.is_err() {
            self.open();
        }
    }
}

/// 20 to 120 ms, by chance (clause 6): the clock's last digits are as good as any.
fn pause() -> Duration {
    Duration::from_micros(20_000 + Instant::now().as_micros() % 100_000)
}
