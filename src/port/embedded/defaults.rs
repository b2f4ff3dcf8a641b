//! What the settings have on every board where nothing else is said.

use core::net::Ipv4Addr;

/// Boards listen on the address that they have.
pub const BIND: Ipv4Addr = Ipv4Addr::UNSPECIFIED;
/// TCP port of every dialect.
pub const MAIN_PORT: u16 = 80;
/// TCP port of Modbus/TCP alone.
pub const MODBUS_PORT: u16 = 502;
/// The address where no DHCP server gives one: that of the thesis' gateway.
pub const ADDRESS: (Ipv4Addr, u8) = (Ipv4Addr::new(192, 168, 1, 111), 24);
/// The router of that network: there is none.
pub const ROUTER: Option<Ipv4Addr> = None;
/// The line of the one bus.
pub const LINE: &str = "rs485-a";
