//! Bytes to texts.

use heapless::{String, Vec};

/// Bytes of the longest text, without its brackets.
pub const MAX_TEXT: usize = 128;

/// A text to send, with its brackets.
pub type Text = String<{ MAX_TEXT + 4 }>;

/// The text that arrives. What is not between `<` and `>` is dropped, and so is a text that is too long.
#[derive(Clone, Debug, Default)]
pub struct Texts {
    text: Vec<u8, MAX_TEXT>,
    place: Place,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Place {
    #[default]
    Outside,
    Inside,
    /// The text is too long.
    Over,
}

impl Texts {
    /// Nothing has arrived yet.
    pub const fn new() -> Self {
        Self { text: Vec::new(), place: Place::Outside }
    }

    /// Takes a byte. Where it ends a text: the text without its brackets, or `None` in its place where it was too long.
    pub fn push(&mut self, byte: u8) -> Option<Option<&[u8]>> {
        match (byte, self.place) {
            (b'<', _) => {
                self.text.clear();
                self.place = Place::Inside;
            }
            (b'>', Place::Inside) => {
                self.place = Place::Outside;
                return Some(Some(&self.text));
            }
            (b'>', Place::Over) => {
                self.place = Place::Outside;
                return Some(None);
            }
            (_, Place::Inside) if self.text.push(byte).is_err() => self.place = Place::Over,
            _ => {}
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    extern crate std;
    use std::vec::Vec;

    fn texts(bytes: &[u8]) -> Vec<Option<Vec<u8>>> {
        let mut texts = Texts::new();
        bytes.iter().filter_map(|byte| texts.push(*byte).map(|text| text.map(<[u8]>::to_vec))).collect()
    }

    #[test]
    fn texts_are_between_brackets() {
        let text = |text: &[u8]| Some(text.to_vec());
        assert_eq!(
            texts(b"< open can0 >\n< rawmode >x> < a < b >"),
            [text(b" open can0 "), text(b" rawmode "), text(b" b ")]
        );
    }

    #[test]
    fn what_is_too_long_is_told_and_the_next_text_is_whole() {
        let mut bytes = b"< ".to_vec();
        bytes.extend_from_slice(&[b'a'; 200]);
        bytes.extend_from_slice(b" >< echo >");
        assert_eq!(texts(&bytes), [None, Some(b" echo ".to_vec())]);
    }
}
