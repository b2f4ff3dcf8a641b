//! What the settings have on the host where nothing else is said.

use core::net::Ipv4Addr;

/// Address to listen on.
pub const BIND: Ipv4Addr = Ipv4Addr::LOCALHOST;
/// TCP port of every dialect.
pub const MAIN_PORT: u16 = 8080;
/// TCP port of Modbus/TCP alone.
pub const MODBUS_PORT: u16 = 8502;
/// A board's address; the host has those of its system.
pub const ADDRESS: (Ipv4Addr, u8) = (Ipv4Addr::new(192, 168, 1, 111), 24);
/// A board's router.
pub const ROUTER: Option<Ipv4Addr> = None;
/// The line of the one bus.
pub const LINE: &str = "sim";
