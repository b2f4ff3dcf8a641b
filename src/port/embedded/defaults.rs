//! What the settings have on every board where nothing else is said.

use core::net::Ipv4Addr;

/// Boards listen on the address that they have.
pub const BIND: Ipv4Addr = Ipv4Addr::UNSPECIFIED;
/// TCP port of every dialect.
pub const MAIN_PORT: u16 = 80;
/// TCP port of Modbus/TCP alone.
pub const MODBUS_PORT: u16 = 502;
/// The line of the one bus.
pub const LINE: &str = "rs485-a";
