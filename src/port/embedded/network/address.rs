//! The board's address on the network: a DHCP server's, or its own.

use core::net::Ipv4Addr;

use embassy_futures::select::{Either, select};
use embassy_net::{ConfigV4, DhcpConfig, Ipv4Cidr, Stack, StaticConfigV4};
use embassy_time::{Duration, with_timeout};
use heapless::String;

use super::mdns::Responder;
use super::socket::Ports;

/// How long a DHCP server is waited for. A server may take 3 s, to see first that nobody has the address that it offers;
/// a PC that is connected directly has none, and somebody waits there.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often it is asked meanwhile: a switch may pass nothing on in the first seconds.
const ASK: smoltcp::time::Duration = smoltcp::time::Duration::from_secs(2);

/// How the board gets its address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// Asks a DHCP server for one first, whenever it is connected to a network.
    pub dhcp: bool,
    /// Its own: without DHCP, or where no server answers.
    pub ip: [u8; 4],
    /// Bits of the network part of its own, 0 to 32.
    pub prefix: u8,
    /// Router of its own network, where there is one.
    pub router: Option<[u8; 4]>,
    /// What it is called: by the DHCP server, and as `.local`.
    pub hostname: String<32>,
}

impl Address {
    fn own(&self) -> StaticConfigV4 {
        StaticConfigV4 {
            address: Ipv4Cidr::new(Ipv4Addr::from(self.ip), self.prefix),
            gateway: self.router.map(Ipv4Addr::from),
            dns_servers: Default::default(),
        }
    }

    fn request(&self) -> DhcpConfig {
        let mut request = DhcpConfig::default();
        request.retry_config.discover_timeout = ASK;
        request.hostname = Some(self.hostname.clone());
        request
    }
}

/// Keeps the board reachable: an address whenever there is a link, and a name.
///
/// An address that is lost takes its connections with it, and with them the leases of commanders.
#[embassy_executor::task]
pub(in crate::port) async fn join(stack: Stack<'static>, address: Address, ports: Ports) -> ! {
    let mut responder = Responder::start(stack, ports);
    loop {
        stack.wait_link_up().await;
        let Some((config, origin)) = obtain(stack, &address).await else { continue };
        log::info!("network: {} at {}, {origin}", address.hostname, config.address);
        select(responder.run(&address.hostname), lost(stack)).await;
        match stack.is_link_up() {
            true => log::warn!("network: {} is lost, the DHCP server has taken it back", config.address),
            false => log::warn!("network: no link"),
        }
    }
}

/// An address, and where it comes from; none where the link is lost meanwhile.
async fn obtain(stack: Stack<'static>, address: &Address) -> Option<(StaticConfigV4, &'static str)> {
    let mut origin = "its own address";
    if address.dhcp {
        stack.set_config_v4(ConfigV4::Dhcp(address.request()));
        match select(with_timeout(PATIENCE, stack.wait_config_up()), stack.wait_link_down()).await {
            Either::First(Ok(())) => return stack.config_v4().map(|config| (config, "from a DHCP server")),
            Either::First(Err(_)) => origin = "its own address: no DHCP server answers",
            Either::Second(()) => return None,
        }
    }
    let own = address.own();
    // Connections survive where it is the same as before.
    if stack.config_v4().as_ref() != Some(&own) {
        stack.set_config_v4(ConfigV4::Static(own.clone()));
    }
    Some((own, origin))
}

async fn lost(stack: Stack<'static>) {
    select(stack.wait_link_down(), stack.wait_config_down()).await;
}
