//! TCP/IP over a board's Ethernet.

use core::net::Ipv4Addr;

use embassy_net::driver::Driver;
use embassy_net::{Config, Ipv4Cidr, Runner, Stack, StackResources, StaticConfigV4};
use static_cell::ConstStaticCell;

use super::limits::SLOTS;

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
pub(in crate::port) fn network<D: Driver>(
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
