//! Bytes to text.

use core::fmt::{self, Write};

use heapless::Vec;

use super::{DataType, real};

/// Shows an object as its bytes come. A number whose object has another size is shown in hex.
#[derive(Clone, Debug)]
pub struct Encoder {
    kind: DataType,
    /// Something has been written.
    begun: bool,
    /// Bytes of a number; of base64 those that make no group of four digits yet.
    held: Vec<u8, 8>,
}

impl Encoder {
    /// Characters that so many bytes become, at most.
    pub const fn room(bytes: usize) -> usize {
        3 * bytes + LONGEST
    }

    /// One for an object of this type.
    pub const fn new(kind: DataType) -> Self {
        Self { kind, begun: false, held: Vec::new() }
    }

    /// The next bytes of the object: writes no more than [`Encoder::room`] of them.
    pub fn push(&mut self, bytes: &[u8], out: &mut impl FnMut(u8)) {
        match self.kind {
            DataType::Hex => self.hex(bytes, out),
            DataType::Text => self.text(bytes, out),
            DataType::Base64 => bytes.iter().for_each(|byte| self.base64(*byte, out)),
            kind => {
                let size = usize::from(kind.size().unwrap_or_default());
                if self.held.len() + bytes.len() <= size {
                    // There is room.
                    let _ = self.held.extend_from_slice(bytes);
                } else {
                    self.as_hex(out);
                    self.hex(bytes, out);
                }
            }
        }
    }

    /// The object has ended: writes no more than [`Encoder::room`] of no bytes.
    pub fn end(mut self, out: &mut impl FnMut(u8)) {
        match self.kind {
            DataType::Hex => {}
            DataType::Text => {
                self.text(&[], out);
                out(b'"');
            }
            DataType::Base64 if self.held.is_empty() => {}
            DataType::Base64 => self.group(out),
            kind if kind.size().is_some_and(|size| usize::from(size) == self.held.len()) => {
                // What takes the characters does not fail.
                let _ = self.number(&mut Out(out));
            }
            _ => self.as_hex(out),
        }
    }

    /// What was taken for a number is none.
    fn as_hex(&mut self, out: &mut impl FnMut(u8)) {
        self.kind = DataType::Hex;
        let held = core::mem::take(&mut self.held);
        self.hex(&held, out);
    }

    fn hex(&mut self, bytes: &[u8], out: &mut impl FnMut(u8)) {
        for byte in bytes {
            if core::mem::replace(&mut self.begun, true) {
                out(b' ');
            }
            for nibble in [byte >> 4, byte & 15] {
                out(if nibble < 10 { b'0' + nibble } else { b'A' + (nibble - 10) });
            }
        }
    }

    /// In quotes, those inside doubled; what would end the line early is left out, and so are zeros.
    fn text(&mut self, bytes: &[u8], out: &mut impl FnMut(u8)) {
        if !core::mem::replace(&mut self.begun, true) {
            out(b'"');
        }
        for byte in bytes {
            match byte {
                0 | b'\r' => {}
                b'"' => [b'"'; 2].into_iter().for_each(&mut *out),
                byte => out(*byte),
            }
        }
    }

    fn base64(&mut self, byte: u8, out: &mut impl FnMut(u8)) {
        // A group is written as soon as it is whole.
        let _ = self.held.push(byte);
        if self.held.len() == 3 {
            self.group(out);
        }
    }

    /// Four digits for three bytes; padding in the last ones.
    fn group(&mut self, out: &mut impl FnMut(u8)) {
        const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let byte = |at: usize| u32::from(self.held.get(at).copied().unwrap_or_default());
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for at in 0..4 {
            let digit = word >> (18 - 6 * at) & 63;
            let padding = at > self.held.len();
            out(if padding { b'=' } else { DIGITS.get(digit as usize).copied().unwrap_or_default() });
        }
        self.held.clear();
    }

    fn number(&self, out: &mut impl Write) -> fmt::Result {
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(&self.held).for_each(|(to, from)| *to = *from);
        let [a, b, c, d, ..] = bytes;
        let number = u64::from_le_bytes(bytes);
        match self.kind {
            DataType::Signed(size) => {
                let unused = 64 - 8 * u32::from(size.clamp(1, 8));
                write!(out, "{}", (number << unused) as i64 >> unused)
            }
            DataType::Hexadecimal(size) => write!(out, "0x{number:0width$X}", width = 2 * usize::from(size)),
            DataType::Real(4) => real::show(ryu::Buffer::new().format(f32::from_le_bytes([a, b, c, d])), out),
            DataType::Real(_) => real::show(ryu::Buffer::new().format(f64::from_le_bytes(bytes)), out),
            _ => write!(out, "{number}"),
        }
    }
}

/// The longest number: `r64` with 17 digits.
const LONGEST: usize = 32;

/// Takes text character by character.
struct Out<'o, O>(&'o mut O);

impl<O: FnMut(u8)> Write for Out<'_, O> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.bytes().for_each(&mut *self.0);
        Ok(())
    }
}
