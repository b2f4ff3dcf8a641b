//! The objects of CiA 402, with their types.

use puente_canopen::Address;
use puente_canopen::pdo::Mapped;

/// Type of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// 8 bits, unsigned.
    U8,
    /// 8 bits, signed.
    I8,
    /// 16 bits, unsigned.
    U16,
    /// 16 bits, signed.
    I16,
    /// 32 bits, unsigned.
    U32,
    /// 32 bits, signed.
    I32,
}

impl Kind {
    /// Its bytes.
    pub const fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 => 4,
        }
    }

    /// The value of a few bytes, the low one first, extended by its sign where it has one; `None` where they are not as many
    /// as it has.
    pub fn read(self, bytes: &[u8]) -> Option<i64> {
        if bytes.len() != self.size() {
            return None;
        }
        let raw = bytes.iter().rev().fold(0_u32, |raw, byte| raw << 8 | u32::from(*byte));
        Some(self.extend(raw))
    }

    /// The value of the lowest bits of `raw`.
    pub const fn extend(self, raw: u32) -> i64 {
        match self {
            Self::U8 => raw as u8 as i64,
            Self::I8 => raw as u8 as i8 as i64,
            Self::U16 => raw as u16 as i64,
            Self::I16 => raw as u16 as i16 as i64,
            Self::U32 => raw as i64,
            Self::I32 => raw as i32 as i64,
        }
    }

    /// Whether the type has a value.
    pub const fn holds(self, value: i64) -> bool {
        let (low, high) = match self {
            Self::U8 => (0, u8::MAX as i64),
            Self::I8 => (i8::MIN as i64, i8::MAX as i64),
            Self::U16 => (0, u16::MAX as i64),
            Self::I16 => (i16::MIN as i64, i16::MAX as i64),
            Self::U32 => (0, u32::MAX as i64),
            Self::I32 => (i32::MIN as i64, i32::MAX as i64),
        };
        low <= value && value <= high
    }
}

/// An object: where it is, and its type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Where.
    pub address: Address,
    /// Its type.
    pub kind: Kind,
}

impl Object {
    /// An object.
    pub const fn new(index: u16, sub: u8, kind: Kind) -> Self {
        Self { address: Address::new(index, sub), kind }
    }

    /// Its entry in a PDO's mapping.
    pub const fn mapped(self) -> Mapped {
        Mapped { address: self.address, bits: 8 * self.kind.size() as u8 }
    }
}

macro_rules! objects {
    ($($name:ident = $index:literal : $sub:literal $kind:ident, $text:literal;)*) => {
        $(#[doc = concat!($text, ".")] pub const $name: Object = Object::new($index, $sub, Kind::$kind);)*

        /// All of the above.
        pub const ALL: &[Object] = &[$($name),*];
    };
}

objects! {
    ERROR_CODE = 0x603F:0 U16, "Last error";
    CONTROLWORD = 0x6040:0 U16, "Controlword";
    STATUSWORD = 0x6041:0 U16, "Statusword";
    VL_TARGET = 0x6042:0 I16, "Velocity mode: target, r/min";
    CONNECTION_OPTION = 0x6007:0 I16, "What the loss of the master does";
    QUICK_STOP_OPTION = 0x605A:0 I16, "What a quick stop does";
    SHUTDOWN_OPTION = 0x605B:0 I16, "What a shutdown does";
    DISABLE_OPTION = 0x605C:0 I16, "What disable operation does";
    HALT_OPTION = 0x605D:0 I16, "What a halt does";
    FAULT_OPTION = 0x605E:0 I16, "What a fault reaction does";
    MODE = 0x6060:0 I8, "Mode of operation";
    MODE_DISPLAY = 0x6061:0 I8, "Mode of operation that is active";
    POSITION_DEMAND = 0x6062:0 I32, "Position demand, position units";
    POSITION = 0x6064:0 I32, "Actual position, position units";
    FOLLOWING_WINDOW = 0x6065:0 U32, "Following error window, position units";
    FOLLOWING_TIMEOUT = 0x6066:0 U16, "Following error time-out, ms";
    POSITION_WINDOW = 0x6067:0 U32, "Position window, position units";
    POSITION_TIME = 0x6068:0 U16, "Position window time, ms";
    VELOCITY_DEMAND = 0x606B:0 I32, "Velocity demand, velocity units";
    VELOCITY = 0x606C:0 I32, "Actual velocity, velocity units";
    TARGET_TORQUE = 0x6071:0 I16, "Target torque, thousandths of the rated torque";
    TORQUE = 0x6077:0 I16, "Actual torque, thousandths of the rated torque";
    TARGET_POSITION = 0x607A:0 I32, "Target position, position units";
    HOME_OFFSET = 0x607C:0 I32, "Home offset, position units";
    LIMIT_LOW = 0x607D:1 I32, "Software limit, low, position units";
    LIMIT_HIGH = 0x607D:2 I32, "Software limit, high, position units";
    POLARITY = 0x607E:0 U8, "Polarity";
    MAX_PROFILE_VELOCITY = 0x607F:0 U32, "Highest profile velocity, velocity units";
    PROFILE_VELOCITY = 0x6081:0 U32, "Profile velocity, velocity units";
    PROFILE_ACCELERATION = 0x6083:0 U32, "Profile acceleration, acceleration units";
    PROFILE_DECELERATION = 0x6084:0 U32, "Profile deceleration, acceleration units";
    QUICK_STOP_DECELERATION = 0x6085:0 U32, "Quick stop deceleration, acceleration units";
    MOTION_PROFILE = 0x6086:0 I16, "Shape of motion profiles";
    HOMING_METHOD = 0x6098:0 I8, "Homing method";
    HOMING_FAST = 0x6099:1 U32, "Homing speed to the switch, velocity units";
    HOMING_SLOW = 0x6099:2 U32, "Homing speed to the zero, velocity units";
    HOMING_ACCELERATION = 0x609A:0 U32, "Homing acceleration, acceleration units";
    INTERPOLATION_SUBMODE = 0x60C0:0 I16, "Interpolation submode, 0 linear";
    INTERPOLATION_SET_POINT = 0x60C1:1 I32, "Interpolation set-point, position units";
    INTERPOLATION_RELATIVE = 0x60C1:2 U8, "Festo: 0 the set-point is absolute, 1 relative";
    PERIOD_VALUE = 0x60C2:1 U8, "Interpolation period, units of its exponent";
    PERIOD_EXPONENT = 0x60C2:2 I8, "Interpolation period, exponent of 10 s";
    INPUTS = 0x60FD:0 U32, "Digital inputs: bit 0 negative limit, 1 positive limit, 2 home";
    TARGET_VELOCITY = 0x60FF:0 I32, "Target velocity, velocity units";
    SUPPORTED_MODES = 0x6502:0 U32, "Supported modes";
}
