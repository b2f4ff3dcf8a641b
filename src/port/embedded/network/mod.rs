//! TCP/IP over a board's Ethernet.

mod address;
mod backlog;
mod doors;
#[cfg(feature = "test-hooks")]
mod echo;
mod mdns;
mod socket;

use embassy_executor::Spawner;
use embassy_net::driver::Driver;
use embassy_net::{Config, Runner, Stack, StackResources};
use static_cell::StaticCell;

pub use address::Address;
pub(in crate::port) use backlog::Patient;
pub use socket::{Place, Socket};

use crate::port::Link;
use crate::port::embedded::limits::SLOTS;
use address::join;
use socket::{Ports, places};

/// One for every client, one for DHCP, one for mDNS; one more for the echo in images for tests.
const SOCKETS: usize = SLOTS + 2 + cfg!(feature = "test-hooks") as usize;

/// The board's connection to its network.
pub struct Network(Stack<'static>);

/// The network, without an address yet, and what has to run for it. `seed` makes TCP sequence numbers hard to guess.
/// Call it once.
pub(in crate::port) fn network<D: Driver>(device: D, seed: u64) -> (Network, Runner<'static, Patient<D>>) {
    static RESOURCES: StaticCell<StackResources<SOCKETS>> = StaticCell::new();
    let (stack, runner) =
        embassy_net::new(Patient(device), Config::default(), RESOURCES.init_with(StackResources::new), seed);
    (Network(stack), runner)
}

impl Network {
    /// Its state.
    pub fn link(&self) -> Link {
        match (self.0.is_link_up(), self.0.is_config_up()) {
            (false, _) => Link::Down,
            (true, false) => Link::NoAddress,
            (true, true) => Link::Up,
        }
    }

    /// The places for clients on the main and the Modbus/TCP port. Call it once.
    pub fn places(&self, main: u16, modbus: u16) -> [Place; SLOTS] {
        places(self.0, Ports { main, modbus })
    }

    /// Gets an address, and makes itself known with these TCP ports. Call it once.
    pub fn join(&self, spawner: Spawner, address: Address, main: u16, modbus: u16) {
        let join = join(self.0, address, Ports { main, modbus });
        spawner.spawn(join.expect("the network is joined once"));
        #[cfg(feature = "test-hooks")]
        spawner.spawn(echo::serve(self.0).expect("the network is joined once"));
    }
}
