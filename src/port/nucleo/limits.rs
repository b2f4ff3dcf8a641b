//! How much this port has room for. `cargo xtask size` says what it costs.

/// Places for clients, both TCP ports together.
pub const SLOTS: usize = MAIN_SLOTS + MODBUS_SLOTS;
/// Of these, on the main port.
pub const MAIN_SLOTS: usize = 18;
/// Of these, on the Modbus/TCP port.
pub const MODBUS_SLOTS: usize = 6;
