//! What is wrong with a file.

use core::fmt;

/// What is wrong, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Error {
    /// The line; the first is 1.
    pub line: u32,
    /// What is wrong with it.
    pub mistake: Mistake,
}

/// What is wrong with a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mistake {
    /// Something stands before the first section.
    NoSection,
    /// A section's name has no end.
    Header,
    /// The line of an object is no `key=value`.
    Line,
    /// The line of an object, or a section's name, is longer than [`LINE`](crate::LINE).
    Long,
    /// No number of the size that is needed.
    Number,
    /// No access type.
    Access,
    /// The file ends, and there was no object in it.
    NoObject,
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoSection => "something stands before the first section",
            Self::Header => "the name of the section has no ']'",
            Self::Line => "an object has lines 'key=value' only",
            Self::Long => "the line is too long",
            Self::Number => "no number of the size that is needed",
            Self::Access => "no access type; there are ro, wo, rw, rwr, rww and const",
            Self::NoObject => "the file ends without an object",
        })
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.mistake)
    }
}

impl core::error::Error for Error {}
