//! TCP/IP over a board's Ethernet.

use embassy_net::driver::Driver;
use embassy_net::{Config, Runner, Stack, StackResources};
use static_cell::StaticCell;

use super::backlog::Patient;
use super::limits::SLOTS;

/// One for every client, one for DHCP, one for mDNS.
const SOCKETS: usize = SLOTS + 2;

/// The stack, without an address yet, and what has to run for it. `seed` makes TCP sequence numbers hard to guess. Call
/// it once.
pub(in crate::port) fn network<D: Driver>(
    device: D,
    seed: u64,
) -> (Stack<'static>, Runner<'static, Patient<D>>) {
    static RESOURCES: StaticCell<StackResources<SOCKETS>> = StaticCell::new();
    embassy_net::new(Patient(device), Config::default(), RESOURCES.init_with(StackResources::new), seed)
}
