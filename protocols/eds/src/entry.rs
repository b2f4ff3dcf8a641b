//! What a file tells.

/// Something that a file tells of an object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry<'a> {
    /// The name of an array or record, or of one of its values of which the [`Object`] has come before.
    Name {
        /// Index.
        index: u16,
        /// Sub-index of the value; none where the whole has this name.
        sub: Option<u8>,
        /// The name, up to [`NAME`](crate::NAME) bytes of it.
        name: &'a str,
    },
    /// A value, or several that are alike.
    Object(Object<'a>),
}

/// A value of an object dictionary, or several that are alike (`CompactSubObj`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object<'a> {
    /// Index.
    pub index: u16,
    /// First sub-index.
    pub first: u8,
    /// Last sub-index; the same as the first where it is one value.
    pub last: u8,
    /// The name (`ParameterName`), up to [`NAME`](crate::NAME) bytes of it; empty where there are several.
    pub name: &'a str,
    /// The data type.
    pub kind: DataType,
    /// How it may be accessed, where that is said.
    pub access: Option<Access>,
    /// It may be mapped into a PDO.
    pub pdo: bool,
    /// The lowest value that is allowed (`LowLimit`), as it stands there, or empty: see [`Number`](crate::Number).
    pub low: &'a str,
    /// The highest value that is allowed (`HighLimit`).
    pub high: &'a str,
    /// The value after power-on (`DefaultValue`).
    pub default: &'a str,
    /// What this device is configured to (`ParameterValue`, in a DCF).
    pub value: &'a str,
}

/// How an object may be accessed (7.4.5.2 of CiA 301).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// `ro`: read.
    Ro,
    /// `wo`: written.
    Wo,
    /// `rw`: both.
    Rw,
    /// `rwr`: both, and it may be in a TPDO.
    Rwr,
    /// `rww`: both, and it may be in an RPDO.
    Rww,
    /// `const`: read, and it is always the same.
    Const,
}

impl Access {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Ro, Self::Wo, Self::Rw, Self::Rwr, Self::Rww, Self::Const];

    /// As files have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ro => "ro",
            Self::Wo => "wo",
            Self::Rw => "rw",
            Self::Rwr => "rwr",
            Self::Rww => "rww",
            Self::Const => "const",
        }
    }

    /// The one of a name.
    pub(crate) fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|access| access.name().eq_ignore_ascii_case(name))
    }
}

/// A data type, by the index that CiA 301 gives it (7.4.7.1, table 44); 0 where none is said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DataType(pub u16);

macro_rules! types {
    ($($name:ident = $code:literal, $size:expr;)*) => {
        #[allow(missing_docs, reason = "names of the standard")]
        impl DataType {
            $(pub const $name: Self = Self($code);)*
        }

        impl DataType {
            /// The standard's name of it; none for a type of the maker's own.
            pub const fn name(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some(stringify!($name)),)*
                    _ => None,
                }
            }

            /// How many bytes it has; none where that is not fixed or not known.
            pub const fn size(self) -> Option<u8> {
                match self.0 {
                    $($code => $size,)*
                    _ => None,
                }
            }
        }
    };
}

types! {
    BOOLEAN = 0x01, Some(1);
    INTEGER8 = 0x02, Some(1);
    INTEGER16 = 0x03, Some(2);
    INTEGER32 = 0x04, Some(4);
    UNSIGNED8 = 0x05, Some(1);
    UNSIGNED16 = 0x06, Some(2);
    UNSIGNED32 = 0x07, Some(4);
    REAL32 = 0x08, Some(4);
    VISIBLE_STRING = 0x09, None;
    OCTET_STRING = 0x0A, None;
    UNICODE_STRING = 0x0B, None;
    TIME_OF_DAY = 0x0C, Some(6);
    TIME_DIFFERENCE = 0x0D, Some(6);
    DOMAIN = 0x0F, None;
    INTEGER24 = 0x10, Some(3);
    REAL64 = 0x11, Some(8);
    INTEGER40 = 0x12, Some(5);
    INTEGER48 = 0x13, Some(6);
    INTEGER56 = 0x14, Some(7);
    INTEGER64 = 0x15, Some(8);
    UNSIGNED24 = 0x16, Some(3);
    UNSIGNED40 = 0x18, Some(5);
    UNSIGNED48 = 0x19, Some(6);
    UNSIGNED56 = 0x1A, Some(7);
    UNSIGNED64 = 0x1B, Some(8);
}

impl DataType {
    /// It is an INTEGER of any size.
    pub const fn signed(self) -> bool {
        matches!(self.0, 0x02..=0x04 | 0x10 | 0x12..=0x15)
    }

    /// It is an INTEGER or UNSIGNED of any size, or a BOOLEAN.
    pub const fn whole(self) -> bool {
        self.signed() || matches!(self.0, 0x01 | 0x05..=0x07 | 0x16 | 0x18..=0x1B)
    }
}
