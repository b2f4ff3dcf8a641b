//! TCP/IP over a board's Ethernet.

use core::net::Ipv4Addr;

use embassy_net::driver::Driver;
use embassy_net::{Config, Ipv4Cidr, Runner, Stack, StackResources, StaticConfigV4};
use static_cell::ConstStaticCell;

use super::limits::SLOTS;
use crate::port::Link;

/// Places for clients, and one of the stack's own; one more for the echo in images for tests.
const SOCKETS: usize = SLOTS + 1 + cfg!(feature = "test-hooks") as usize;

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

/// The stack, and what has to run for it. `seed` makes TCP sequence numbers hard to guess. Call it once.
pub(in crate::port) fn stack<D: Driver>(
    device: D,
    address: Address,
    seed: u64,
) -> (Stack<'static>, Runner<'static, D>) {
    static RESOURCES: ConstStaticCell<StackResources<SOCKETS>> = ConstStaticCell::new(StackResources::new());
    let config = Config::ipv4_static(StaticConfigV4 {
        address: Ipv4Cidr::new(Ipv4Addr::from(address.ip), address.prefix),
        gateway: address.gateway.map(Ipv4Addr::from),
        dns_servers: Default::default(),
    });
    embassy_net::new(device, config, RESOURCES.take(), seed)
}

/// The board's connection to its network.
pub struct Network(pub(in crate::port) Stack<'static>);

impl Network {
    /// Its state.
    pub fn link(&self) -> Link {
        match (self.0.is_link_up(), self.0.is_config_up()) {
            (false, _) => Link::Down,
            (true, false) => Link::NoAddress,
            (true, true) => Link::Up,
        }
    }
}
