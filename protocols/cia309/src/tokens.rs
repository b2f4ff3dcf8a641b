//! The words of a line.

use crate::{Error, number};

/// Longest word that is no value.
const MAX_WORD: usize = 20;

/// The words of a line that are left. A `#` begins a comment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tokens<'l>(&'l [u8]);

impl<'l> Tokens<'l> {
    pub(crate) const fn new(line: &'l [u8]) -> Self {
        Self(line)
    }

    /// What is left, from its first word on.
    pub(crate) fn rest(self) -> &'l [u8] {
        let start = self.0.iter().position(|byte| byte.is_ascii_graphic()).unwrap_or(self.0.len());
        self.0.get(start..).unwrap_or_default()
    }

    /// The next word; none at the end.
    pub(crate) fn next(&mut self) -> Result<Option<&'l [u8]>, Error> {
        let rest = self.rest();
        let of_word = |byte: &u8| byte.is_ascii_graphic() && *byte != b'#';
        let end = rest.iter().position(|byte| !of_word(byte)).unwrap_or(rest.len());
        let (word, rest) = rest.split_at_checked(end).unwrap_or_default();
        // Nothing after a comment has begun.
        self.0 = if rest.starts_with(b"#") { &[] } else { rest };
        match word.len() {
            0 => {
                self.0 = &[];
                Ok(None)
            }
            1..=MAX_WORD => Ok(Some(word)),
            _ => Err(Error::Syntax),
        }
    }

    /// Whether there is no other word.
    pub(crate) fn is_empty(self) -> bool {
        matches!(self.rest().first(), None | Some(b'#'))
    }

    /// The next word, which there must be.
    pub(crate) fn word(&mut self) -> Result<&'l [u8], Error> {
        self.next()?.ok_or(Error::Syntax)
    }

    /// The next word as a number from `min` to `max`.
    pub(crate) fn number(&mut self, min: u32, max: u32) -> Result<u32, Error> {
        let number = number::unsigned(self.word()?).and_then(|number| u32::try_from(number).ok());
        number.filter(|number| (min..=max).contains(number)).ok_or(Error::Syntax)
    }

    /// Nothing else may follow.
    pub(crate) fn end(self) -> Result<(), Error> {
        if self.is_empty() { Ok(()) } else { Err(Error::Syntax) }
    }
}

/// Whether a word is this one, in capitals or not.
pub(crate) const fn is(word: &[u8], name: &str) -> bool {
    word.eq_ignore_ascii_case(name.as_bytes())
}
