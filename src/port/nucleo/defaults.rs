//! What the settings have where nothing else is said.

use core::net::Ipv4Addr;

pub use crate::port::embedded::defaults::{BIND, LINE, MAIN_PORT, MODBUS_PORT};

/// The address of the thesis' gateway.
pub const ADDRESS: (Ipv4Addr, u8) = (Ipv4Addr::new(192, 168, 1, 111), 24);
/// None: the thesis' network has no other.
pub const ROUTER: Option<Ipv4Addr> = None;
