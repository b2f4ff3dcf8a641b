//! What the settings have where nothing else is said.

use core::net::Ipv4Addr;

pub use crate::port::embedded::defaults::{BIND, LINE, MAIN_PORT, MODBUS_PORT};

/// Where QEMU's user network expects its guest.
pub const ADDRESS: (Ipv4Addr, u8) = (Ipv4Addr::new(10, 0, 2, 15), 24);
/// QEMU itself.
pub const ROUTER: Option<Ipv4Addr> = Some(Ipv4Addr::new(10, 0, 2, 2));
