//! Clients that come when no place listens wait, as at any server whose backlog is full.
//!
//! The stack has no backlog: it refuses them. Here its refusal is not sent, and the doors are told. A client that gets no
//! answer knocks again, after a second at first, and a place is free by then: each listens again as soon as its last
//! client is gone.

use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Context;

use embassy_net::driver::{Capabilities, Driver, HardwareAddress, LinkState, TxToken};
use smoltcp::wire::{EthernetFrame, EthernetProtocol, IpProtocol, Ipv4Packet, TcpPacket, TcpSeqNumber};

use super::doors;
use super::socket::Ports;
use crate::port::Door;

/// Bytes of the frame that refuses a client: Ethernet, IPv4 and TCP without options.
const REFUSAL: usize = 14 + 20 + 20;

/// The ports at which nobody is refused, one in each half.
static PORTS: AtomicU32 = AtomicU32::new(0);

/// Refuses nobody at these ports any more.
pub(super) fn open(ports: Ports) {
    PORTS.store(u32::from(ports.main) << 16 | u32::from(ports.modbus), Ordering::Relaxed);
}

/// A device that does not send refusals.
pub(in crate::port) struct Patient<D>(pub D);

impl<D: Driver> Driver for Patient<D> {
    type RxToken<'a>
        = D::RxToken<'a>
    where
        Self: 'a;
    type TxToken<'a>
        = Unless<D::TxToken<'a>>
    where
        Self: 'a;

    fn receive(&mut self, context: &mut Context<'_>) -> Option<(Self::RxToken<'_>, Self::TxToken<'_>)> {
        let (received, reply) = self.0.receive(context)?;
        Some((received, Unless(reply)))
    }

    fn transmit(&mut self, context: &mut Context<'_>) -> Option<Self::TxToken<'_>> {
        self.0.transmit(context).map(Unless)
    }

    fn link_state(&mut self, context: &mut Context<'_>) -> LinkState {
        self.0.link_state(context)
    }

    fn capabilities(&self) -> Capabilities {
        self.0.capabilities()
    }

    fn hardware_address(&self) -> HardwareAddress {
        self.0.hardware_address()
    }
}

/// Room for a frame, which is sent unless it refuses a client.
pub(in crate::port) struct Unless<T>(T);

impl<T: TxToken> TxToken for Unless<T> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        if length != REFUSAL {
            return self.0.consume(length, f);
        }
        let mut frame = [0; REFUSAL];
        let result = f(&mut frame);
        match refused(&frame) {
            Some(door) => doors::missed(door),
            None => self.0.consume(length, |room| room.copy_from_slice(&frame)),
        }
        result
    }
}

/// The door at which a frame refuses a client. It answers a SYN with RST: with the sequence number 0 then, and with an
/// acknowledgement (RFC 9293, section 3.10.7.1).
fn refused(frame: &[u8]) -> Option<Door> {
    let frame = EthernetFrame::new_checked(frame).ok()?;
    let ip = Ipv4Packet::new_checked(frame.payload()).ok()?;
    if frame.ethertype() != EthernetProtocol::Ipv4 || ip.next_header() != IpProtocol::Tcp {
        return None;
    }
    let tcp = TcpPacket::new_checked(ip.payload()).ok()?;
    if !tcp.rst() || !tcp.ack() || tcp.seq_number() != TcpSeqNumber(0) {
        return None;
    }
    let (ports, port) = (PORTS.load(Ordering::Relaxed), u32::from(tcp.src_port()));
    match port {
        _ if port == ports >> 16 => Some(Door::Main),
        _ if port == ports & 0xFFFF => Some(Door::Modbus),
        _ => None,
    }
}
