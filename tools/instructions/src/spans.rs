//! Counts from one call to another.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use crate::map;

/// Stretches that are counted apart.
const STRETCHES: usize = 64;

struct Spans {
    begins: usize,
    ends: usize,
    next: usize,
    /// The sum where the last span has begun.
    begun: AtomicU64,
    stretch: AtomicUsize,
    /// Spans, instructions, most; for each stretch.
    file: &'static [AtomicU64],
}

static SPANS: OnceLock<Spans> = OnceLock::new();

/// Begins to count, where the options ask for it.
pub fn start<'o>(option: impl Fn(&str) -> Option<&'o str>) -> Result<(), String> {
    let Some(file) = option("spans") else { return Ok(()) };
    let address = |name| {
        let number = option(name).and_then(|text| text.parse::<usize>().ok());
        number.ok_or_else(|| format!("the option {name}=ADDRESS is missing"))
    };
    let spans = Spans {
        begins: address("begins")?,
        ends: address("ends")?,
        next: address("next")?,
        begun: AtomicU64::new(0),
        stretch: AtomicUsize::new(0),
        file: map(file, STRETCHES * 3).map_err(|error| format!("{file}: {error}"))?,
    };
    let _ = SPANS.set(spans);
    Ok(())
}

/// The block at `place` is about to run, after `sum` instructions.
pub fn reached(place: usize, sum: u64) {
    let Some(spans) = SPANS.get() else { return };
    if place == spans.begins {
        spans.begun.store(sum, Ordering::Relaxed);
    } else if place == spans.ends {
        spans.ended(sum);
    } else if place == spans.next {
        spans.stretch.fetch_add(1, Ordering::Relaxed);
    }
}

impl Spans {
    fn ended(&self, sum: u64) {
        let length = sum - self.begun.load(Ordering::Relaxed);
        let at = self.stretch.load(Ordering::Relaxed) * 3;
        if let Some([spans, instructions, most]) = self.file.get(at..at + 3) {
            spans.fetch_add(1, Ordering::Relaxed);
            instructions.fetch_add(length, Ordering::Relaxed);
            most.fetch_max(length, Ordering::Relaxed);
        }
    }
}
