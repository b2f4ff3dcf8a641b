//! The sections of a file.

/// What a section tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Section {
    /// None has begun.
    None,
    /// Nothing of the object dictionary: of the file, of the device, lists of objects.
    Other,
    /// `[1018]`.
    Object(u16),
    /// `[1018sub1]`.
    Sub(u16, u8),
    /// `[1003Name]`: names of values that are alike.
    Names(u16),
}

impl Section {
    /// The section of a name.
    pub(crate) fn parse(name: &str) -> Self {
        let Some((index, rest)) = name.split_at_checked(4) else { return Self::Other };
        let Some(index) = hexadecimal(index) else { return Self::Other };
        match rest.split_at_checked(3) {
            _ if rest.is_empty() => Self::Object(index),
            _ if rest.eq_ignore_ascii_case("name") => Self::Names(index),
            Some((word, sub)) if word.eq_ignore_ascii_case("sub") => {
                match hexadecimal(sub).and_then(|sub| u8::try_from(sub).ok()) {
                    Some(sub) => Self::Sub(index, sub),
                    None => Self::Other,
                }
            }
            _ => Self::Other,
        }
    }
}

/// Up to four hexadecimal digits.
fn hexadecimal(text: &str) -> Option<u16> {
    let digits = text.bytes().all(|byte| byte.is_ascii_hexdigit());
    u16::from_str_radix(text, 16).ok().filter(|_| digits)
}
