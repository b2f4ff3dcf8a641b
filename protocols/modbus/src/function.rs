//! Function codes that have typed PDUs (V1.1b3, clause 6).

/// Read Coils.
pub const READ_COILS: u8 = 0x01;
/// Read Discrete Inputs.
pub const READ_DISCRETE_INPUTS: u8 = 0x02;
/// Read Holding Registers.
pub const READ_HOLDING_REGISTERS: u8 = 0x03;
/// Read Input Registers.
pub const READ_INPUT_REGISTERS: u8 = 0x04;
/// Write Single Coil.
pub const WRITE_SINGLE_COIL: u8 = 0x05;
/// Write Single Register.
pub const WRITE_SINGLE_REGISTER: u8 = 0x06;
/// Diagnostics (serial line only).
pub const DIAGNOSTICS: u8 = 0x08;
/// Write Multiple Coils.
pub const WRITE_MULTIPLE_COILS: u8 = 0x0F;
/// Write Multiple Registers.
pub const WRITE_MULTIPLE_REGISTERS: u8 = 0x10;
/// Report Server ID (serial line only).
pub const REPORT_SERVER_ID: u8 = 0x11;
/// Mask Write Register.
pub const MASK_WRITE_REGISTER: u8 = 0x16;
/// Read/Write Multiple Registers.
pub const READ_WRITE_MULTIPLE_REGISTERS: u8 = 0x17;
/// Encapsulated Interface Transport; what it carries is named by the MEI type that follows.
pub const ENCAPSULATED_INTERFACE: u8 = 0x2B;
/// MEI type of Read Device Identification.
pub const MEI_DEVICE_IDENTIFICATION: u8 = 0x0E;
/// Set in the function code of an exception reply.
pub const EXCEPTION: u8 = 0x80;
