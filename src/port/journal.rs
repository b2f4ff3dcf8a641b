//! The log: one front end for every port. It keeps the recent lines, and hands each on to the port.

use core::cell::RefCell;
use core::fmt::{self, Write};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::String;
use log::{Level, LevelFilter, Log, Metadata, Record};

use super::limits::{JOURNAL, JOURNAL_LINE};
use super::platform;

/// What is kept.
const KEPT: Level = Level::Info;

static RING: Mutex<CriticalSectionRawMutex, RefCell<Ring<JOURNAL>>> = Mutex::new(RefCell::new(Ring::new()));

/// A place in the log, between two lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Mark(u64);

/// The place behind the newest line. Before the oldest is `Mark::default()`.
pub fn end() -> Mark {
    RING.lock(|ring| Mark(ring.borrow().end))
}

/// Copies the lines behind `mark`, each with its line feed, as many as fit whole; how many bytes that are. Moves `mark`
/// behind them. Lines that have been dropped meanwhile are passed over.
pub fn read(mark: &mut Mark, room: &mut [u8]) -> usize {
    RING.lock(|ring| ring.borrow().read(mark, room))
}

/// The newest lines, as many as fit `N` bytes.
struct Ring<const N: usize> {
    bytes: [u8; N],
    /// How many bytes there had been before the oldest line that is kept, and behind the newest.
    start: u64,
    end: u64,
}

impl<const N: usize> Ring<N> {
    const fn new() -> Self {
        Self { bytes: [0; N], start: 0, end: 0 }
    }

    /// The kept bytes from a place on, in two pieces.
    fn from(&self, place: u64) -> (&[u8], &[u8]) {
        let (from, to) = ((place % N as u64) as usize, (self.end % N as u64) as usize);
        let piece = |from, to| self.bytes.get(from..to).unwrap_or_default();
        match self.end - place {
            0 => (&[], &[]),
            _ if from < to => (piece(from, to), &[]),
            _ => (piece(from, N), piece(0, to)),
        }
    }

    /// Appends a line, which has no line feed and is shorter than the ring.
    fn push(&mut self, line: &[u8]) {
        let length = line.len() as u64 + 1;
        while self.end + length - self.start > N as u64 && self.start < self.end {
            self.start += self.first_line();
        }
        self.append(line);
        self.append(b"\n");
    }

    fn append(&mut self, bytes: &[u8]) {
        let at = (self.end % N as u64) as usize;
        let (first, second) = bytes.split_at(bytes.len().min(N - at));
        for (at, piece) in [(at, first), (0, second)] {
            if let Some(place) = self.bytes.get_mut(at..at + piece.len()) {
                place.copy_from_slice(piece);
            }
        }
        self.end += bytes.len() as u64;
    }

    /// Length of the oldest line, with its line feed.
    fn first_line(&self) -> u64 {
        let (first, second) = self.from(self.start);
        let length = first.iter().chain(second).position(|byte| *byte == b'\n');
        length.map_or(self.end - self.start, |length| length as u64 + 1)
    }

    fn read(&self, mark: &mut Mark, room: &mut [u8]) -> usize {
        let place = mark.0.clamp(self.start, self.end);
        let (first, second) = self.from(place);
        let mut length = 0;
        for piece in [first, second] {
            let free = room.get_mut(length..).unwrap_or_default();
            let count = piece.len().min(free.len());
            if let (Some(to), Some(from)) = (free.get_mut(..count), piece.get(..count)) {
                to.copy_from_slice(from);
            }
            length += count;
        }
        let copied = room.get(..length).unwrap_or_default();
        let whole = copied.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
        *mark = Mark(place + whole as u64);
        whole
    }
}

/// A line of the log. What does not fit is cut off, and whatever would end the line is a space.
#[derive(Default)]
struct Line(String<JOURNAL_LINE>);

impl Line {
    fn new(record: &Record<'_>) -> Self {
        let mut line = Self::default();
        let ms = embassy_time::Instant::now().as_millis();
        let (seconds, ms) = (ms / 1000, ms % 1000);
        // It takes what fits.
        let _ = write!(line, "[{seconds:5}.{ms:03} {:<5}] {}", record.level(), record.args());
        line
    }
}

impl fmt::Write for Line {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            let character = if character.is_control() { ' ' } else { character };
            self.0.push(character).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

struct Journal;

impl Log for Journal {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.level() <= KEPT || platform::logs(metadata)
    }

    fn log(&self, record: &Record<'_>) {
        let line = Line::new(record);
        if record.level() <= KEPT {
            RING.lock(|ring| ring.borrow_mut().push(line.0.as_bytes()));
        }
        platform::log(record, &line.0);
    }

    fn flush(&self) {}
}

/// Starts the log: `most` is what the port shows, and what is kept at the least.
pub(super) fn start(most: LevelFilter) {
    // Refused only where there is a logger already.
    if log::set_logger(&Journal).is_ok() {
        log::set_max_level(most.max(KEPT.to_level_filter()));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// All that a reader gets who has room for `room` bytes at a time.
    fn read_all(ring: &Ring<100>, room: usize) -> std::string::String {
        let (mut mark, mut all) = (Mark::default(), Vec::new());
        loop {
            let mut bytes = vec![0; room];
            let count = ring.read(&mut mark, &mut bytes);
            if count == 0 {
                break;
            }
            all.extend_from_slice(&bytes[..count]);
        }
        std::string::String::from_utf8(all).expect("text")
    }

    proptest! {
        #[test]
        fn the_newest_lines_are_kept_whole(lines in proptest::collection::vec("[a-zä]{0,20}", 0..40), room in 41..200_usize) {
            let mut ring = Ring::<100>::new();
            for line in &lines {
                ring.push(line.as_bytes());
            }
            let (mut expected, mut fits) = (std::string::String::new(), true);
            for line in lines.iter().rev() {
                fits = fits && expected.len() + line.len() < 100;
                if fits {
                    expected = format!("{line}\n{expected}");
                }
            }
            prop_assert_eq!(read_all(&ring, room), expected);
        }

        #[test]
        fn a_slow_reader_gets_whole_lines_in_order(pushes in proptest::collection::vec(0..12_usize, 1..30), room in 8..40_usize) {
            let mut ring = Ring::<100>::new();
            let (mut number, mut mark, mut last) = (0, Mark::default(), None);
            for count in pushes {
                for _ in 0..count {
                    ring.push(format!("{number:07}").as_bytes());
                    number += 1;
                }
                let mut bytes = vec![0; room];
                let count = ring.read(&mut mark, &mut bytes);
                for line in bytes[..count].chunks(8) {
                    let (digits, end) = line.split_at(7);
                    prop_assert_eq!(end, b"\n");
                    let seen = std::str::from_utf8(digits).expect("text").parse::<u32>().expect("a number");
                    prop_assert!(last < Some(seen));
                    last = Some(seen);
                }
            }
        }
    }

    #[test]
    fn a_line_is_cut_and_stays_one() {
        let text = format!("a\nb{}", "ä".repeat(JOURNAL_LINE));
        let line = Line::new(&Record::builder().level(Level::Warn).args(format_args!("{text}")).build());
        assert!(line.0.contains(" WARN ] a b") && line.0.len() >= JOURNAL_LINE - 1, "{}", line.0);
    }
}
