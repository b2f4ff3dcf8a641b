//! Abort codes.

use core::fmt;

/// Why a transfer was aborted (7.2.4.3.17, table 22). Codes that the table does not have pass, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Abort(pub u32);

macro_rules! codes {
    ($($name:ident = $code:literal, $text:literal;)*) => {
        impl Abort {
            $(#[doc = concat!($text, ".")] pub const $name: Self = Self($code);)*

            /// All of the table, in its order.
            pub const ALL: &'static [Self] = &[$(Self($code)),*];

            /// What it means; `None` where the table does not have it.
            pub const fn text(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some($text),)*
                    _ => None,
                }
            }
        }
    };
}

codes! {
    TOGGLE = 0x0503_0000, "toggle bit not alternated";
    TIMEOUT = 0x0504_0000, "SDO protocol timed out";
    COMMAND = 0x0504_0001, "command specifier not valid or unknown";
    BLOCK_SIZE = 0x0504_0002, "invalid block size";
    SEQUENCE = 0x0504_0003, "invalid sequence number";
    CRC = 0x0504_0004, "CRC error";
    MEMORY = 0x0504_0005, "out of memory";
    UNSUPPORTED = 0x0601_0000, "unsupported access to an object";
    WRITE_ONLY = 0x0601_0001, "attempt to read a write only object";
    READ_ONLY = 0x0601_0002, "attempt to write a read only object";
    NO_OBJECT = 0x0602_0000, "object does not exist";
    NOT_MAPPABLE = 0x0604_0041, "object cannot be mapped to the PDO";
    MAPPING_LENGTH = 0x0604_0042, "mapped objects would exceed the PDO length";
    INCOMPATIBLE = 0x0604_0043, "general parameter incompatibility";
    INTERNAL = 0x0604_0047, "general internal incompatibility in the device";
    HARDWARE = 0x0606_0000, "access failed due to a hardware error";
    LENGTH = 0x0607_0010, "data type or length does not match";
    TOO_LONG = 0x0607_0012, "data type does not match, length too high";
    TOO_SHORT = 0x0607_0013, "data type does not match, length too low";
    NO_SUB_INDEX = 0x0609_0011, "sub-index does not exist";
    VALUE = 0x0609_0030, "invalid value for parameter";
    TOO_HIGH = 0x0609_0031, "value of parameter too high";
    TOO_LOW = 0x0609_0032, "value of parameter too low";
    MAX_BELOW_MIN = 0x0609_0036, "maximum value is less than minimum value";
    RESOURCE = 0x060A_0023, "resource not available: SDO connection";
    GENERAL = 0x0800_0000, "general error";
    TRANSFER = 0x0800_0020, "data cannot be transferred or stored";
    LOCAL_CONTROL = 0x0800_0021, "data cannot be transferred or stored because of local control";
    DEVICE_STATE = 0x0800_0022, "data cannot be transferred or stored because of the device state";
    NO_DICTIONARY = 0x0800_0023, "object dictionary not present or its generation failed";
    NO_DATA = 0x0800_0024, "no data available";
}

impl fmt::Display for Abort {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:08X} {}", self.0, self.text().unwrap_or("unknown abort code"))
    }
}

impl core::error::Error for Abort {}
