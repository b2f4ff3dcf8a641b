//! TCP/IP over a board's Ethernet.

use core::net::Ipv4Addr;

use embassy_net::driver::Driver;
use embassy_net::{Config, Ipv4Cidr, Runner, Stack, StackResources, StaticConfigV4};
use static_cell::ConstStaticCell;

use super::limits::SLOTS;
use super::socket::{Place, Ports, places};

/// The board's address on the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// IPv4 address.
    pub ip: [u8; 4],
    /// Bits of the network part, 0 to 32.
    pub prefix: u8,
    /// Router, where there is one.
    pub gateway: Option<[u8; 4]>,
}

/// A board on the network.
pub struct Network {
    /// The board's MAC address.
    pub mac: [u8; 6],
    pub(in crate::port) stack: Stack<'static>,
}

impl Network {
    /// The places for clients on the main and the Modbus/TCP port. Call it once.
    pub fn places(&self, main: u16, modbus: u16) -> [Place; SLOTS] {
        places(self.stack, Ports { main, modbus })
    }
}

/// The stack, and what has to run for it. `seed` makes TCP sequence numbers hard to guess. Call it once.
pub(in crate::port) fn stack<D: Driver>(
    device: D,
    address: Address,
    seed: u64,
) -> (Stack<'static>, Runner<'static, D>) {
    static RESOURCES: ConstStaticCell<StackResources<{ SLOTS + 1 }>> =
        ConstStaticCell::new(StackResources::new());
    let config = Config::ipv4_static(StaticConfigV4 {
        address: Ipv4Cidr::new(Ipv4Addr::from(address.ip), address.prefix),
        gateway: address.gateway.map(Ipv4Addr::from),
        dns_servers: Default::default(),
    });
    embassy_net::new(device, config, RESOURCES.take(), seed)
}
