//! A DHCP server for one board.

use smoltcp::iface::SocketHandle;
use smoltcp::wire::{DhcpMessageType, DhcpPacket, DhcpRepr, EthernetAddress};

use crate::common::ethernet::Host;

/// The UDP port of servers.
pub const SERVER: u16 = 67;
const CLIENT: u16 = 68;
const HOSTNAME: u8 = 12;

/// What a client says.
pub struct Heard {
    kind: DhcpMessageType,
    transaction: u32,
    client: EthernetAddress,
    pub hostname: String,
}

impl Heard {
    pub fn read(bytes: &[u8]) -> Self {
        let packet = DhcpPacket::new_checked(bytes).expect("a DHCP message");
        let message = DhcpRepr::parse(&packet).expect("a DHCP message");
        let name = packet.options().find(|option| option.kind == HOSTNAME);
        Self {
            kind: message.message_type,
            transaction: message.transaction_id,
            client: message.client_hardware_address,
            hostname: name.map_or(String::new(), |name| String::from_utf8_lossy(name.data).into_owned()),
        }
    }
}

/// It offers one address, as long as it is asked to.
pub struct Server {
    socket: SocketHandle,
    own: [u8; 4],
    offer: [u8; 4],
    seconds: u32,
    pub granted: u32,
}

impl Server {
    /// On `host`, which is at `own`.
    pub fn new(host: &mut Host, own: [u8; 4], offer: [u8; 4], seconds: u32) -> Self {
        Self { socket: host.udp(SERVER, None), own, offer, seconds, granted: 0 }
    }

    /// Answers what has come.
    pub fn serve(&mut self, host: &mut Host) {
        while let Some((bytes, _)) = host.datagram(self.socket) {
            let heard = Heard::read(&bytes);
            let kind = match heard.kind {
                DhcpMessageType::Discover => DhcpMessageType::Offer,
                DhcpMessageType::Request => {
                    self.granted += 1;
                    DhcpMessageType::Ack
                }
                _ => continue,
            };
            let reply = self.reply(&heard, kind);
            host.send(self.socket, &reply, ([255; 4].into(), CLIENT));
        }
    }

    fn reply(&self, heard: &Heard, kind: DhcpMessageType) -> Vec<u8> {
        let reply = DhcpRepr {
            message_type: kind,
            transaction_id: heard.transaction,
            secs: 0,
            client_hardware_address: heard.client,
            client_ip: [0; 4].into(),
            your_ip: self.offer.into(),
            server_ip: self.own.into(),
            router: Some(self.own.into()),
            subnet_mask: Some([255, 255, 255, 0].into()),
            relay_agent_ip: [0; 4].into(),
            broadcast: true,
            requested_ip: None,
            client_identifier: None,
            server_identifier: Some(self.own.into()),
            parameter_request_list: None,
            dns_servers: None,
            max_size: None,
            lease_duration: Some(self.seconds),
            renew_duration: None,
            rebind_duration: None,
            additional_options: &[],
        };
        let mut bytes = vec![0; reply.buffer_len()];
        reply.emit(&mut DhcpPacket::new_unchecked(&mut bytes)).expect("room");
        bytes
    }
}
