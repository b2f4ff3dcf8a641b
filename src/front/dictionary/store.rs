//! The records of all nodes, one node's behind the other's, and behind them those of a file that is coming.

use heapless::Vec;
use puente_canopen::NodeId;
use puente_eds::Entry;

use super::record::{self, Record};
use crate::port::limits::{DICTIONARIES, DICTIONARY};

/// A node of a bus, by the bus' index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::front) struct Whose {
    pub bus: u8,
    pub node: NodeId,
}

/// What there is of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::front) struct Held {
    whose: Whose,
    bytes: usize,
    /// Objects that are kept, or several that are alike,
    pub objects: u32,
    /// and those for which there was no room.
    pub left_out: u32,
}

/// Empty at first, so that a static one takes no flash.
pub(super) struct Store {
    held: Vec<Held, DICTIONARIES>,
    bytes: Vec<u8, DICTIONARY>,
    coming: Option<Held>,
}

impl Store {
    pub const fn new() -> Self {
        Self { held: Vec::new(), bytes: Vec::new(), coming: None }
    }

    pub fn held(&self, whose: Whose) -> Option<Held> {
        self.held.iter().find(|held| held.whose == whose).copied()
    }

    /// A file of this node comes.
    pub fn begin(&mut self, whose: Whose) {
        self.remove(whose);
        self.coming = Some(Held { whose, bytes: 0, objects: 0, left_out: 0 });
    }

    /// The next entry of the file. What has no room is left out.
    pub fn add(&mut self, entry: &Entry<'_>) {
        let Some(held) = &mut self.coming else { return };
        let written = record::write(entry, &mut self.bytes);
        held.bytes += written.unwrap_or_default();
        match (entry, written) {
            (Entry::Object(_), Some(_)) => held.objects += 1,
            (Entry::Object(_), None) => held.left_out += 1,
            (Entry::Name { .. }, _) => {}
        }
    }

    /// The file has ended. Where there are too many nodes all of it is left out.
    pub fn end(&mut self) -> Option<Held> {
        let held = self.coming?;
        if self.held.push(held).is_ok() {
            self.coming = None;
            return Some(held);
        }
        self.give_up();
        Some(Held { bytes: 0, objects: 0, left_out: held.objects + held.left_out, ..held })
    }

    /// The file does not come to its end.
    pub fn give_up(&mut self) {
        if let Some(held) = self.coming.take() {
            self.bytes.truncate(self.bytes.len().saturating_sub(held.bytes));
        }
    }

    pub fn remove(&mut self, whose: Whose) {
        let Some(at) = self.held.iter().position(|held| held.whose == whose) else { return };
        let start = self.start(at);
        let end = start + self.held.remove(at).bytes;
        let length = self.bytes.len();
        if end <= length {
            self.bytes.copy_within(end.., start);
            self.bytes.truncate(length - (end - start));
        }
    }

    /// Where the bytes of one begin.
    fn start(&self, at: usize) -> usize {
        self.held.iter().take(at).map(|held| held.bytes).sum()
    }

    /// What is known of a node.
    pub fn records(&self, whose: Whose) -> Records<'_> {
        let bytes = self.held.iter().position(|held| held.whose == whose).and_then(|at| {
            let start = self.start(at);
            self.bytes.get(start..start + self.held.get(at)?.bytes)
        });
        Records(bytes.unwrap_or_default())
    }
}

/// Records, one after the other.
#[derive(Clone)]
pub(super) struct Records<'b>(&'b [u8]);

impl<'b> Iterator for Records<'b> {
    type Item = Record<'b>;

    fn next(&mut self) -> Option<Record<'b>> {
        let (record, rest) = Record::read(self.0)?;
        self.0 = rest;
        Some(record)
    }
}
