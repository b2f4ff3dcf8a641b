//! Bytes to lines.

use heapless::Vec;

/// Bytes of the longest line, with its end: an extended frame with 8 bytes and a time stamp.
pub const MAX_LINE: usize = 1 + 8 + 1 + 16 + 4 + 1;

/// A line to send, with its end.
pub type Text = Vec<u8, MAX_LINE>;

/// What ends a line, or stands alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// CR.
    Return,
    /// BEL: an adapter refuses a command.
    Bell,
}

/// The line that arrives.
///
/// LF and zero bytes are dropped wherever they are: some clients send them. Of a line that is too long, nothing is kept.
#[derive(Clone, Debug, Default)]
pub struct Lines {
    line: Vec<u8, MAX_LINE>,
    /// The line in `line` has ended.
    ended: bool,
    /// The line is too long.
    over: bool,
}

impl Lines {
    /// Nothing has arrived yet.
    pub const fn new() -> Self {
        Self { line: Vec::new(), ended: false, over: false }
    }

    /// Takes a byte. Where it ends a line: which end it is, and the line without it; `None` in place of the line where it was
    /// too long.
    pub fn push(&mut self, byte: u8) -> Option<(End, Option<&[u8]>)> {
        if core::mem::take(&mut self.ended) {
            self.line.clear();
            self.over = false;
        }
        let end = match byte {
            b'\r' => End::Return,
            0x07 => End::Bell,
            b'\n' | 0 => return None,
            _ => {
                self.over |= self.line.push(byte).is_err();
                return None;
            }
        };
        self.ended = true;
        Some((end, (!self.over).then_some(self.line.as_slice())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::vec::Vec;

    fn lines(bytes: &[u8]) -> Vec<(End, Option<Vec<u8>>)> {
        let mut lines = Lines::new();
        bytes
            .iter()
            .filter_map(|byte| lines.push(*byte).map(|(end, line)| (end, line.map(<[u8]>::to_vec))))
            .collect()
    }

    #[test]
    fn lines_end_with_cr_or_bel() {
        let line = |text: &[u8]| Some(text.to_vec());
        assert_eq!(
            lines(b"O\r\x07\rz\r\nF\x07t"),
            [
                (End::Return, line(b"O")),
                (End::Bell, line(b"")),
                (End::Return, line(b"")),
                (End::Return, line(b"z")),
                (End::Bell, line(b"F")),
            ]
        );
    }

    #[test]
    fn what_is_too_long_is_told_and_the_next_line_is_whole() {
        let mut bytes = [b'A'; 100].to_vec();
        bytes.extend_from_slice(b"\rS6\r");
        assert_eq!(lines(&bytes), [(End::Return, None), (End::Return, Some(b"S6".to_vec()))]);
        let mut longest = [b'0'; MAX_LINE].to_vec();
        longest.push(b'\r');
        assert_eq!(lines(&longest), [(End::Return, Some([b'0'; MAX_LINE].to_vec()))]);
    }
}
