//! The data types of objects: bytes to text and text to bytes.

mod decoder;
mod encoder;
mod real;

pub use decoder::{BadValue, Decoder};
pub use encoder::Encoder;

/// How the bytes of an object are said.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DataType {
    /// `hex`: bytes, `0A FF`. What is read without a type comes so.
    Hex,
    /// `i8` to `i64`: signed, of so many bytes.
    Signed(u8),
    /// `u8` to `u64`, and `b`: unsigned, of so many bytes.
    Unsigned(u8),
    /// `x8` to `x64`: unsigned, of so many bytes, shown in hex.
    Hexadecimal(u8),
    /// `r32`, `r64`: real, of so many bytes.
    Real(u8),
    /// `vs`: text.
    Text,
    /// `os`, `us`, `d`: base64 (RFC 2045) in one line.
    Base64,
}

impl DataType {
    const NAMES: [(&'static str, Self); 20] = [
        ("hex", Self::Hex),
        ("b", Self::Unsigned(1)),
        ("i8", Self::Signed(1)),
        ("i16", Self::Signed(2)),
        ("i32", Self::Signed(4)),
        ("i64", Self::Signed(8)),
        ("u8", Self::Unsigned(1)),
        ("u16", Self::Unsigned(2)),
        ("u32", Self::Unsigned(4)),
        ("u64", Self::Unsigned(8)),
        ("x8", Self::Hexadecimal(1)),
        ("x16", Self::Hexadecimal(2)),
        ("x32", Self::Hexadecimal(4)),
        ("x64", Self::Hexadecimal(8)),
        ("r32", Self::Real(4)),
        ("r64", Self::Real(8)),
        ("vs", Self::Text),
        ("os", Self::Base64),
        ("us", Self::Base64),
        ("d", Self::Base64),
    ];

    /// The type of a name, in capitals or not; `None` for others. `t` and `td` are not known.
    pub fn parse(name: &[u8]) -> Option<Self> {
        Self::NAMES.iter().find(|(known, _)| crate::tokens::is(name, known)).map(|(_, kind)| *kind)
    }

    /// All names, with their types.
    pub fn names() -> impl Iterator<Item = (&'static str, Self)> {
        Self::NAMES.into_iter()
    }

    /// How many bytes it has; none where that is not fixed.
    pub const fn size(self) -> Option<u8> {
        match self {
            Self::Signed(size) | Self::Unsigned(size) | Self::Hexadecimal(size) | Self::Real(size) => {
                Some(size)
            }
            Self::Hex | Self::Text | Self::Base64 => None,
        }
    }
}
