//! Values of objects, as text and in JSON.

use core::fmt::{self, Write as _};

use heapless::Vec;
use puente_cia309::value::{DataType, Decoder, Encoder};
use serde::{Serialize, Serializer};

/// The bytes of a value that is said as CiA 309-3 has it, but for text: that is taken as it is. None where it is no value, or
/// there is no room for it.
pub(in crate::front) fn decode<const N: usize>(text: &[u8], kind: DataType) -> Option<Vec<u8, N>> {
    if kind == DataType::Text {
        return Vec::from_slice(text).ok().filter(|bytes| !bytes.is_empty());
    }
    let mut bytes = Vec::new();
    let mut decoder = Decoder::new(kind);
    let mut fits = true;
    let mut out = |byte| fits &= bytes.push(byte).is_ok();
    for byte in text {
        decoder.push(*byte, &mut out).ok()?;
    }
    decoder.end(&mut out).ok()?;
    fits.then_some(bytes)
}

/// The value of an object: a number, or text as CiA 309-3 has it.
pub(in crate::front) struct Shown<'a> {
    pub bytes: &'a [u8],
    pub kind: DataType,
}

impl Serialize for Shown<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut wide = [0; 8];
        let fits = self.kind.size().map(usize::from) == Some(self.bytes.len());
        let room = wide.get_mut(..self.bytes.len()).filter(|_| fits);
        let Some(room) = room else { return serializer.collect_str(self) };
        room.copy_from_slice(self.bytes);
        let unused = 64 - 8 * self.bytes.len() as u32;
        match (self.kind, wide) {
            (DataType::Unsigned(_), wide) => serializer.serialize_u64(u64::from_le_bytes(wide)),
            (DataType::Signed(_), wide) => {
                // The sign goes as far up as there is room.
                let high = i64::from_le_bytes(wide).checked_shl(unused).unwrap_or_default();
                serializer.serialize_i64(high.checked_shr(unused).unwrap_or_default())
            }
            (DataType::Real(4), [a, b, c, d, ..]) => {
                serializer.serialize_f32(f32::from_le_bytes([a, b, c, d]))
            }
            (DataType::Real(_), wide) => serializer.serialize_f64(f64::from_le_bytes(wide)),
            _ => serializer.collect_str(self),
        }
    }
}

impl fmt::Display for Shown<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.kind == DataType::Text {
            return text(self.bytes, f);
        }
        let mut written = Ok(());
        let mut out = |byte| written = written.and_then(|()| f.write_char(char::from(byte)));
        let mut encoder = Encoder::new(self.kind);
        encoder.push(self.bytes, &mut out);
        encoder.end(&mut out);
        written
    }
}

/// Text ends where the node has ended it. What is not UTF-8 is taken for Latin-1.
fn text(bytes: &[u8], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let bytes = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    match core::str::from_utf8(bytes) {
        Ok(text) => f.write_str(text),
        Err(_) => bytes.iter().try_for_each(|byte| f.write_char(char::from(*byte))),
    }
}
