//! The document as JSON, with the keys that it has in TOML.

use core::fmt;

use serde::de::DeserializeSeed;

use super::document::Place;
use super::{Problem, Settings, VERSION};

/// Why a text is no document.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Error {
    /// It is of another version.
    Version(u32),
    /// It is not the JSON that is expected.
    Json(serde_json_core::de::Error),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::Version(version) => Problem::Version(*version).fmt(f),
            // The reader keeps no words of its own for a key or a value that is not known.
            Error::Json(serde_json_core::de::Error::CustomError) => f.write_str(
                "a key is missing, given twice or not known, or a value is not one that its key takes",
            ),
            Error::Json(error) => write!(f, "this is not JSON as expected: {error}"),
        }
    }
}

/// Longest text with escapes.
const ESCAPED: usize = 128;

/// Reads a document into its place, without [checking](Settings::check) it. Where that fails, half of it may be there.
pub fn read(text: &[u8], settings: &mut Settings) -> Result<(), Error> {
    let mut escaped = [0; ESCAPED];
    let mut deserializer = serde_json_core::de::Deserializer::new(text, Some(&mut escaped));
    *settings = Settings::blank();
    let read = Place(settings).deserialize(&mut deserializer).and_then(|()| deserializer.end());
    // Another version has other keys: that is what there is to say then.
    match (read, version(text)) {
        (Ok(_), _) => Ok(()),
        (Err(_), Some(version)) if version != VERSION => Err(Error::Version(version)),
        (Err(error), _) => Err(Error::Json(error)),
    }
}

/// The version that a text gives, whatever else is in it.
fn version(text: &[u8]) -> Option<u32> {
    let (mut depth, mut rest) = (0_u32, text);
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        match byte {
            b'{' | b'[' => depth = depth.saturating_add(1),
            b'}' | b']' => depth = depth.saturating_sub(1),
            b'"' => {
                let (string, after) = string(rest)?;
                rest = after;
                if let (1, b"version", [b':', value @ ..]) = (depth, string, rest.trim_ascii_start()) {
                    let value = value.trim_ascii_start();
                    let digits = value.iter().take_while(|byte| byte.is_ascii_digit()).count();
                    return core::str::from_utf8(value.get(..digits)?).ok()?.parse().ok();
                }
            }
            _ => {}
        }
    }
    None
}

/// The rest of a string that has begun, and what follows it.
fn string(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let mut escaped = false;
    let end = text.iter().position(|byte| {
        let ends = *byte == b'"' && !escaped;
        escaped = *byte == b'\\' && !escaped;
        ends
    })?;
    Some((text.get(..end)?, text.get(end + 1..)?))
}
