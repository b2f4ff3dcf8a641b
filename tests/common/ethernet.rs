//! Another host on the Ethernet of an emulated board, with a TCP/IP stack of its own, and frames made by hand.

use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant as Clock};

use smoltcp::iface::{Config, Interface, SocketHandle, SocketSet};
use smoltcp::phy::{self, ChecksumCapabilities, Device, DeviceCapabilities, Medium};
use smoltcp::socket::{tcp, udp};
use smoltcp::time::Instant;
use smoltcp::wire::{
    EthernetAddress, EthernetFrame, EthernetProtocol, EthernetRepr, IpAddress, IpCidr, IpEndpoint,
    IpProtocol, Ipv4Packet, Ipv4Repr, TcpPacket, UdpPacket, UdpRepr,
};

/// Longest frame without its check sequence.
const FRAME: usize = 1514;

/// The cable to a board: frames as QEMU gives and takes them.
pub struct Cable {
    /// Where QEMU connects to.
    pub address: SocketAddr,
    arrived: Receiver<Arrived>,
    board: Option<TcpStream>,
    frames: VecDeque<Vec<u8>>,
    /// Every frame that has come, once it is wanted.
    pub kept: Option<Vec<Vec<u8>>>,
    /// TCP ports of this side whose frames are lost, whichever way they go.
    pub lost: Vec<u16>,
}

enum Arrived {
    /// QEMU has started.
    Board(TcpStream),
    Frame(Vec<u8>),
}

impl Cable {
    pub fn new() -> Self {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
        let address = listener.local_addr().expect("its address");
        let (to, arrived) = channel();
        thread::spawn(move || {
            let (mut stream, _) = listener.accept().expect("QEMU");
            stream.set_nodelay(true).expect("no delay");
            let _ = to.send(Arrived::Board(stream.try_clone().expect("a clone")));
            let mut length = [0; 4];
            while stream.read_exact(&mut length).is_ok() {
                let mut frame = vec![0; u32::from_be_bytes(length) as usize];
                if stream.read_exact(&mut frame).is_err() || to.send(Arrived::Frame(frame)).is_err() {
                    return;
                }
            }
        });
        Self { address, arrived, board: None, frames: VecDeque::new(), kept: None, lost: Vec::new() }
    }

    fn look(&mut self) {
        while let Ok(arrived) = self.arrived.try_recv() {
            match arrived {
                Arrived::Board(stream) => self.board = Some(stream),
                Arrived::Frame(frame) if self.is_lost(&frame) => {}
                Arrived::Frame(frame) => {
                    if let Some(kept) = &mut self.kept {
                        kept.push(frame.clone());
                    }
                    self.frames.push_back(frame);
                }
            }
        }
    }

    fn is_lost(&self, frame: &[u8]) -> bool {
        let ports = || {
            let ip = Ipv4Packet::new_checked(EthernetFrame::new_checked(frame).ok()?.payload()).ok()?;
            let tcp =
                TcpPacket::new_checked(ip.payload()).ok().filter(|_| ip.next_header() == IpProtocol::Tcp)?;
            Some([tcp.src_port(), tcp.dst_port()])
        };
        !self.lost.is_empty()
            && ports().is_some_and(|ports| ports.iter().any(|port| self.lost.contains(port)))
    }

    /// Sends a frame; there is nobody to take it before QEMU has started.
    pub fn send(&mut self, frame: &[u8]) {
        self.look();
        if self.is_lost(frame) {
            return;
        }
        if let Some(board) = &mut self.board {
            let length = (frame.len() as u32).to_be_bytes();
            // In one piece; the board may be gone.
            let _ = board.write_all(&[&length[..], frame].concat());
        }
    }
}

/// A UDP datagram in a frame.
pub fn datagram(
    from: (EthernetAddress, [u8; 4], u16),
    to: (EthernetAddress, [u8; 4], u16),
    payload: &[u8],
) -> Vec<u8> {
    let udp = UdpRepr { src_port: from.2, dst_port: to.2 };
    let ip = Ipv4Repr {
        src_addr: from.1.into(),
        dst_addr: to.1.into(),
        next_header: IpProtocol::Udp,
        payload_len: udp.header_len() + payload.len(),
        hop_limit: 255,
    };
    let ethernet = EthernetRepr { src_addr: from.0, dst_addr: to.0, ethertype: EthernetProtocol::Ipv4 };
    let checksums = ChecksumCapabilities::default();
    let mut frame = vec![0; ethernet.buffer_len() + ip.buffer_len() + ip.payload_len];
    let mut outer = EthernetFrame::new_unchecked(&mut frame);
    ethernet.emit(&mut outer);
    let mut middle = Ipv4Packet::new_unchecked(outer.payload_mut());
    ip.emit(&mut middle, &checksums);
    let mut inner = UdpPacket::new_unchecked(middle.payload_mut());
    let (source, target) = (ip.src_addr.into(), ip.dst_addr.into());
    udp.emit(&mut inner, &source, &target, payload.len(), |to| to.copy_from_slice(payload), &checksums);
    frame
}

pub struct Taken(Vec<u8>);

impl phy::RxToken for Taken {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, f: F) -> R {
        f(&self.0)
    }
}

pub struct Sending<'a>(&'a mut Cable);

impl phy::TxToken for Sending<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let mut frame = vec![0; length];
        let result = f(&mut frame);
        self.0.send(&frame);
        result
    }
}

impl Device for Cable {
    type RxToken<'a> = Taken;
    type TxToken<'a> = Sending<'a>;

    fn receive(&mut self, _: Instant) -> Option<(Taken, Sending<'_>)> {
        self.look();
        let frame = self.frames.pop_front()?;
        Some((Taken(frame), Sending(self)))
    }

    fn transmit(&mut self, _: Instant) -> Option<Sending<'_>> {
        Some(Sending(self))
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = FRAME;
        capabilities
    }
}

/// A host at the end of a cable. It lives only while it is asked for something.
pub struct Host {
    pub cable: Cable,
    interface: Interface,
    sockets: SocketSet<'static>,
    started: Clock,
    port: u16,
}

impl Host {
    /// Its MAC address.
    pub const MAC: EthernetAddress = EthernetAddress([2, 0, 0, 0, 0, 0x77]);

    /// A host with this address, on a network of 24 bits.
    pub fn new(mut cable: Cable, address: [u8; 4]) -> Self {
        let mut interface = Interface::new(Config::new(Self::MAC.into()), &mut cable, Instant::ZERO);
        interface.update_ip_addrs(|addresses| {
            addresses.push(IpCidr::new(IpAddress::Ipv4(address.into()), 24)).expect("room for one");
        });
        Self { cable, interface, sockets: SocketSet::new(vec![]), started: Clock::now(), port: 49_152 }
    }

    /// Takes and sends what there is.
    pub fn poll(&mut self) {
        let now = Instant::from_micros(self.started.elapsed().as_micros() as i64);
        self.interface.poll(now, &mut self.cable, &mut self.sockets);
    }

    /// Lives until something has happened; false where it does not within `time`.
    pub fn lives(&mut self, time: Duration, mut happened: impl FnMut(&mut Self) -> bool) -> bool {
        let start = Clock::now();
        loop {
            self.poll();
            if happened(self) {
                return true;
            }
            if start.elapsed() > time {
                return false;
            }
            thread::sleep(Duration::from_micros(200));
        }
    }

    /// Lives until something has happened that is bound to.
    pub fn until(&mut self, what: &str, happened: impl FnMut(&mut Self) -> bool) {
        assert!(self.lives(Duration::from_secs(60), happened), "never: {what}");
    }

    /// A TCP socket.
    pub fn socket(&mut self) -> SocketHandle {
        let buffer = || tcp::SocketBuffer::new(vec![0; 4096]);
        self.sockets.add(tcp::Socket::new(buffer(), buffer()))
    }

    /// Begins to connect.
    pub fn connect(&mut self, to: ([u8; 4], u16)) -> SocketHandle {
        let handle = self.socket();
        self.reconnect(handle, to);
        handle
    }

    /// Begins to connect again with a socket whose connection is over.
    pub fn reconnect(&mut self, handle: SocketHandle, (ip, port): ([u8; 4], u16)) {
        self.port = self.port.checked_add(1).unwrap_or(49_152);
        let to = IpEndpoint::new(IpAddress::Ipv4(ip.into()), port);
        let socket = self.sockets.get_mut::<tcp::Socket<'_>>(handle);
        socket.abort();
        socket.set_nagle_enabled(false);
        socket.set_ack_delay(None);
        socket.connect(self.interface.context(), to, self.port).expect("a free socket");
    }

    /// Ends a connection with RST, and forgets it.
    pub fn end(&mut self, handle: SocketHandle) {
        self.tcp(handle).abort();
        self.poll();
        self.sockets.remove(handle);
    }

    pub fn tcp(&mut self, handle: SocketHandle) -> &mut tcp::Socket<'static> {
        self.sockets.get_mut(handle)
    }

    /// Sends over a new or open connection, and waits for a line; nothing where there is none within `time`.
    pub fn ask(&mut self, handle: SocketHandle, line: &str, time: Duration) -> Option<String> {
        let mut sent = false;
        let mut reply = Vec::new();
        let answered = self.lives(time, |host| {
            let socket = host.tcp(handle);
            if !sent && socket.can_send() {
                sent = socket.send_slice(format!("{line}\r\n").as_bytes()).is_ok();
            }
            let _ = socket.recv(|bytes| {
                reply.extend_from_slice(bytes);
                (bytes.len(), ())
            });
            reply.ends_with(b"\n")
        });
        answered.then(|| String::from_utf8_lossy(&reply).trim_end().to_owned())
    }

    /// Whether a console command is answered over a new connection.
    pub fn finds(&mut self, ip: [u8; 4], time: Duration) -> bool {
        let handle = self.connect((ip, 80));
        let found = self.ask(handle, "feed", time).is_some_and(|reply| reply == "ok");
        self.tcp(handle).close();
        self.poll();
        found
    }

    /// A UDP socket, which hears this group too.
    pub fn udp(&mut self, port: u16, group: Option<Ipv4Addr>) -> SocketHandle {
        let buffer = || {
            let packets = (0..32).map(|_| udp::PacketMetadata::EMPTY).collect::<Vec<_>>();
            udp::PacketBuffer::new(packets, vec![0; 16_384])
        };
        let mut socket = udp::Socket::new(buffer(), buffer());
        socket.bind(port).expect("a port");
        socket.set_hop_limit(Some(255));
        if let Some(group) = group {
            self.interface.join_multicast_group(group).expect("room for a group");
        }
        self.sockets.add(socket)
    }

    pub fn send(&mut self, handle: SocketHandle, bytes: &[u8], (ip, port): (Ipv4Addr, u16)) {
        let to = IpEndpoint::new(IpAddress::Ipv4(ip), port);
        self.sockets.get_mut::<udp::Socket<'_>>(handle).send_slice(bytes, to).expect("sent");
        self.poll();
    }

    /// The next datagram, and what is known of it.
    pub fn datagram(&mut self, handle: SocketHandle) -> Option<(Vec<u8>, udp::UdpMetadata)> {
        let socket = self.sockets.get_mut::<udp::Socket<'_>>(handle);
        socket.recv().ok().map(|(bytes, from)| (bytes.to_vec(), from))
    }
}
