//! The lines of a file.

use heapless::{String, Vec};

use crate::draft::{Draft, copy};
use crate::number::unsigned;
use crate::section::Section;
use crate::{Entry, Error, LINE, Mistake, NAME};

/// The mark that some programs put before a text in UTF-8.
const BYTE_ORDER_MARK: &[u8] = b"\xEF\xBB\xBF";

/// Reads a file as it comes. After an error the rest of the file means nothing.
#[derive(Clone, Debug)]
pub struct Reader {
    line: Vec<u8, LINE>,
    /// The line is longer than what is kept of it.
    long: bool,
    number: u32,
    section: Section,
    draft: Draft,
    objects: u32,
}

impl Default for Reader {
    fn default() -> Self {
        Self::new()
    }
}

impl Reader {
    /// At the beginning of a file.
    pub fn new() -> Self {
        Self {
            line: Vec::new(),
            long: false,
            number: 1,
            section: Section::None,
            draft: Draft::default(),
            objects: 0,
        }
    }

    /// The next bytes of the file; what they complete is given to `take`.
    pub fn push(&mut self, bytes: &[u8], take: &mut impl FnMut(Entry<'_>)) -> Result<(), Error> {
        for byte in bytes {
            if *byte == b'\n' {
                self.end_line(take)?;
                self.number = self.number.saturating_add(1);
            } else if self.line.push(*byte).is_err() {
                self.long = true;
            }
        }
        Ok(())
    }

    /// The file ends.
    pub fn end(&mut self, take: &mut impl FnMut(Entry<'_>)) -> Result<(), Error> {
        self.end_line(take)?;
        self.end_section(take);
        if self.objects == 0 { Err(self.error(Mistake::NoObject)) } else { Ok(()) }
    }

    fn error(&self, mistake: Mistake) -> Error {
        Error { line: self.number, mistake }
    }

    fn end_line(&mut self, take: &mut impl FnMut(Entry<'_>)) -> Result<(), Error> {
        let long = core::mem::take(&mut self.long);
        let line = core::mem::take(&mut self.line);
        let mut bytes = line.as_slice();
        if self.number == 1 {
            bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
        }
        let mut latin = String::<{ 2 * LINE }>::new();
        let line = match core::str::from_utf8(bytes) {
            Ok(line) => line,
            // The end of the line may be in the middle of a letter: then the rest is not wanted.
            Err(error) if long && error.error_len().is_none() => {
                core::str::from_utf8(bytes.get(..error.valid_up_to()).unwrap_or_default()).unwrap_or_default()
            }
            Err(_) => {
                for byte in bytes {
                    // There is room: a letter of Latin-1 has two bytes at most.
                    let _ = latin.push(char::from(*byte));
                }
                &latin
            }
        };
        self.read(line.trim(), long, take).map_err(|mistake| self.error(mistake))
    }

    fn read(&mut self, line: &str, long: bool, take: &mut impl FnMut(Entry<'_>)) -> Result<(), Mistake> {
        if line.is_empty() || line.starts_with([';', '#']) {
            return Ok(());
        }
        if let Some(name) = line.strip_prefix('[') {
            let name = match name.split_once(']') {
                Some((name, _)) => name.trim(),
                None if long => return Err(Mistake::Long),
                None => return Err(Mistake::Header),
            };
            self.end_section(take);
            self.section = Section::parse(name);
            return Ok(());
        }
        match self.section {
            Section::None => return Err(Mistake::NoSection),
            Section::Other => return Ok(()),
            _ if long => return Err(Mistake::Long),
            _ => {}
        }
        let (key, value) = line.split_once('=').ok_or(Mistake::Line)?;
        let (key, value) = (key.trim(), without_comment(value).trim());
        match self.section {
            Section::Names(index) => {
                // The first key says how many follow.
                if let Some(sub) = unsigned(key).and_then(|sub| u8::try_from(sub).ok()) {
                    let mut name = String::<NAME>::new();
                    copy(value, &mut name);
                    take(Entry::Name { index, sub: Some(sub), name: &name });
                }
                Ok(())
            }
            _ => self.draft.line(key, value),
        }
    }

    fn end_section(&mut self, take: &mut impl FnMut(Entry<'_>)) {
        match core::mem::replace(&mut self.section, Section::Other) {
            Section::Object(index) => self.draft.object(index, take),
            Section::Sub(index, sub) => self.draft.sub(index, sub, take),
            Section::None | Section::Other | Section::Names(_) => return,
        }
        self.objects = self.objects.saturating_add(1);
        self.draft = Draft::default();
    }
}

/// A comment within a line has a space before it.
fn without_comment(value: &str) -> &str {
    let comment = value.char_indices().find(|(at, letter)| {
        let before = value.get(..*at).and_then(|before| before.chars().next_back());
        *letter == ';' && before.is_none_or(char::is_whitespace)
    });
    comment.and_then(|(at, _)| value.get(..at)).unwrap_or(value)
}
