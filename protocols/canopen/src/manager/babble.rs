//! Who says too much.

use core::time::Duration;

use heapless::Vec;
use puente_line::Instant;

use super::types::BusEvent;
use crate::Id;

const WINDOW: Duration = Duration::from_millis(100);
/// COB-IDs that are counted.
const COUNTED: usize = 8;
/// COB-IDs that are known to babble.
const LOUD: usize = 4;

/// Counts the frames of the most frequent COB-IDs (Misra and Gries): never more than came, and of all `n` frames of a window
/// at most `n / 9` too few.
#[derive(Clone, Debug)]
pub(super) struct Babble {
    limit: u16,
    until: Instant,
    counts: Vec<(Id, u16), COUNTED>,
    loud: Vec<Loud, LOUD>,
}

#[derive(Clone, Copy, Debug)]
struct Loud {
    id: Id,
    /// Too many of it came in this window.
    still: bool,
    /// Whether that has been told.
    told: bool,
    /// It is over; to be told.
    over: bool,
}

impl Babble {
    pub const fn new(limit: u16) -> Self {
        Self { limit, until: Instant::ZERO, counts: Vec::new(), loud: Vec::new() }
    }

    pub fn is_loud(&self, id: Id) -> bool {
        self.loud.iter().any(|loud| loud.id == id && !loud.over)
    }

    /// A frame came.
    pub fn count(&mut self, now: Instant, id: Id) {
        if self.limit == 0 {
            return;
        }
        self.elapse(now);
        let count = match self.counts.iter_mut().find(|(of, _)| *of == id) {
            Some((_, count)) => {
                *count = count.saturating_add(1);
                *count
            }
            None => {
                if self.counts.push((id, 1)).is_err() {
                    self.counts.iter_mut().for_each(|(_, count)| *count -= 1);
                    self.counts.retain(|(_, count)| *count > 0);
                }
                1
            }
        };
        if count <= self.limit {
            return;
        }
        match self.loud.iter_mut().find(|loud| loud.id == id) {
            Some(loud) => {
                loud.still = true;
                loud.over = false;
            }
            None => {
                let _ = self.loud.push(Loud { id, still: true, told: false, over: false });
            }
        }
    }

    /// A window without too many frames ends it.
    pub fn elapse(&mut self, now: Instant) {
        if now < self.until {
            return;
        }
        self.until = now + WINDOW;
        self.counts.clear();
        for loud in &mut self.loud {
            loud.over = !loud.still;
            loud.still = false;
        }
    }

    pub fn event(&mut self) -> Option<BusEvent> {
        if let Some(loud) = self.loud.iter_mut().find(|loud| !loud.told) {
            loud.told = true;
            return Some(BusEvent::Babbling(loud.id));
        }
        let over = self.loud.iter().position(|loud| loud.over)?;
        Some(BusEvent::Quiet(self.loud.swap_remove(over).id))
    }

    pub fn poll_at(&self) -> Option<Instant> {
        if self.loud.iter().any(|loud| !loud.told || loud.over) {
            return Some(Instant::ZERO);
        }
        (!self.loud.is_empty()).then_some(self.until)
    }
}
