//! Frames that were heard, for whoever follows.

use core::num::NonZeroU32;

use puente_framed::frame::{HEADER, MAX_FRAME};
use puente_framed::section;

use crate::desk::Units;
use crate::port::limits::HEARD;

/// Bytes of a frame's length, which goes before it.
const LENGTH: usize = 2;
/// Bytes between a packet and the end of its frame.
const TAIL: usize = 2;

/// The newest frames, as many as there is room for.
pub(super) struct Heard {
    ring: [u8; HEARD],
    /// Where the oldest begins in the ring.
    start: usize,
    oldest: Mark,
    end: Mark,
}

/// How far somebody has come: the next frame for him. Both modulo 2^32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mark {
    /// Bytes that were kept before it.
    at: u32,
    /// Frames that were.
    serial: u32,
}

/// What follows a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// A frame of so many bytes.
    Frame(usize),
    /// So many frames that have been dropped.
    Lost(NonZeroU32),
}

impl Heard {
    pub(super) const fn new() -> Self {
        const { assert!(HEARD >= LENGTH + MAX_FRAME, "the longest frame has no room") };
        let none = Mark { at: 0, serial: 0 };
        Self { ring: [0; HEARD], start: 0, oldest: none, end: none }
    }

    /// Where the next frame will be.
    pub(super) fn end(&self) -> Mark {
        self.end
    }

    /// Keeps a frame; the oldest ones make room.
    pub(super) fn push(&mut self, frame: &[u8]) {
        let Ok(length) = u16::try_from(frame.len()) else { return };
        let needed = LENGTH + frame.len();
        if needed > HEARD {
            return;
        }
        while HEARD - self.end.since(self.oldest) < needed {
            self.drop_oldest();
        }
        let at = self.end.since(self.oldest);
        for (to, from) in [(at, &length.to_be_bytes()[..]), (at + LENGTH, frame)] {
            let index = self.index(to);
            let room = self.ring.get_mut(index..).unwrap_or_default();
            let (front, back) = from.split_at(from.len().min(room.len()));
            copy(front, room);
            copy(back, &mut self.ring);
        }
        self.end = self.end.after(needed, 1);
    }

    /// What follows the mark for any of these addresses; the mark passes over all before it.
    pub(super) fn next(&self, mark: &mut Mark, addresses: &Units) -> Option<Next> {
        // A mark is never ahead of the end: half of all numbers are before the oldest.
        let behind = self.oldest.serial.wrapping_sub(mark.serial);
        if let Some(lost) = NonZeroU32::new(behind).filter(|behind| behind.get() <= u32::MAX / 2) {
            return Some(Next::Lost(lost));
        }
        while *mark != self.end {
            let at = mark.since(self.oldest);
            let length = self.length(at);
            if self.is_for(at + LENGTH, length, addresses) {
                return Some(Next::Frame(length));
            }
            *mark = mark.after(LENGTH + length, 1);
        }
        None
    }

    /// The same; a frame is copied to `buffer`, as much of it as has room, and the mark goes on behind it, or behind what is
    /// lost.
    pub(super) fn read(&self, mark: &mut Mark, addresses: &Units, buffer: &mut [u8]) -> Option<Next> {
        let next = self.next(mark, addresses)?;
        match next {
            Next::Lost(_) => *mark = self.oldest,
            Next::Frame(length) => {
                let from = self.index(mark.since(self.oldest) + LENGTH);
                let front = self.ring.get(from..).unwrap_or_default();
                let front = front.get(..length).unwrap_or(front);
                copy(front, buffer);
                let back = self.ring.get(..length - front.len()).unwrap_or_default();
                copy(back, buffer.get_mut(front.len()..).unwrap_or_default());
                *mark = mark.after(LENGTH + length, 1);
            }
        }
        Some(next)
    }

    /// Whether a frame has a section for any of these addresses.
    fn is_for(&self, frame: usize, length: usize, addresses: &Units) -> bool {
        let end = frame + length.saturating_sub(TAIL);
        let mut at = frame + HEADER;
        while at < end {
            if addresses.contains(self.byte(at)) {
                return true;
            }
            at += section::OVERHEAD + usize::from(self.byte(at + 1));
        }
        false
    }

    fn length(&self, at: usize) -> usize {
        u16::from_be_bytes([self.byte(at), self.byte(at + 1)]).into()
    }

    /// A byte by its distance from the oldest frame.
    fn byte(&self, at: usize) -> u8 {
        self.ring.get(self.index(at)).copied().unwrap_or_default()
    }

    fn index(&self, at: usize) -> usize {
        (self.start + at) % HEARD
    }

    fn drop_oldest(&mut self) {
        let bytes = LENGTH + self.length(0);
        self.start = self.index(bytes);
        self.oldest = self.oldest.after(bytes, 1);
    }
}

/// Copies as much as has room.
fn copy(from: &[u8], to: &mut [u8]) {
    let length = from.len().min(to.len());
    if let (Some(from), Some(to)) = (from.get(..length), to.get_mut(..length)) {
        to.copy_from_slice(from);
    }
}

impl Mark {
    fn after(self, bytes: usize, frames: u32) -> Self {
        Self { at: self.at.wrapping_add(bytes as u32), serial: self.serial.wrapping_add(frames) }
    }

    /// Bytes from another mark to this one.
    fn since(self, other: Self) -> usize {
        self.at.wrapping_sub(other.at) as usize
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    /// A plain frame with a section of `data` bytes for each address; its checks do not count here.
    fn frame(addresses: &[u8], data: u8, tag: u8) -> Vec<u8> {
        let mut packet = Vec::new();
        for address in addresses {
            packet.extend([*address, data]);
            packet.extend(core::iter::repeat_n(tag, data.into()));
            packet.push(section::TERMINATOR);
        }
        let [high, low] = (packet.len() as u16).to_be_bytes();
        let mut frame = std::vec![0x7E, 9, high, low];
        frame.extend(packet);
        frame.extend([tag, 0x0A]);
        frame
    }

    fn set(addresses: &[u8]) -> Units {
        let mut set = Units::default();
        addresses.iter().for_each(|address| set.insert(*address));
        set
    }

    fn read(heard: &Heard, mark: &mut Mark, addresses: &Units) -> Option<Result<Vec<u8>, u32>> {
        let mut buffer = [0; MAX_FRAME];
        Some(match heard.read(mark, addresses, &mut buffer)? {
            Next::Frame(length) => Ok(buffer[..length].to_vec()),
            Next::Lost(lost) => Err(lost.get()),
        })
    }

    #[test]
    fn each_reads_what_is_for_it() {
        let mut heard = Heard::new();
        let (mut a, mut b) = (heard.end(), heard.end());
        let frames = [frame(&[1], 20, 1), frame(&[2, 1], 30, 2), frame(&[3], 20, 3), frame(&[2], 0, 4)];
        frames.iter().for_each(|frame| heard.push(frame));
        assert_eq!(read(&heard, &mut a, &set(&[1])), Some(Ok(frames[0].clone())));
        assert_eq!(read(&heard, &mut a, &set(&[1])), Some(Ok(frames[1].clone())));
        assert_eq!(read(&heard, &mut a, &set(&[1])), None);
        assert_eq!(heard.next(&mut b, &set(&[2, 9])), Some(Next::Frame(frames[1].len())));
        assert_eq!(read(&heard, &mut b, &set(&[2, 9])), Some(Ok(frames[1].clone())));
        assert_eq!(read(&heard, &mut b, &set(&[2, 9])), Some(Ok(frames[3].clone())));
        assert_eq!((read(&heard, &mut b, &set(&[2])), b), (None, heard.end()));
    }

    /// What is inside a section is no address.
    #[test]
    fn data_are_no_addresses() {
        let mut heard = Heard::new();
        let mut mark = heard.end();
        heard.push(&frame(&[5], 40, 7));
        assert_eq!(read(&heard, &mut mark, &set(&[7, 0x0D, 0x7E, 0x0A, 40, 9])), None);
    }

    proptest! {
        /// The same as a queue of whole frames, from any start, however the numbers wrap.
        #[test]
        fn as_a_queue(
            start in any::<u32>(),
            serial in any::<u32>(),
            steps in prop::collection::vec((0..=4_u8, 0..=255_u8, any::<bool>()), 1..200),
        ) {
            let mut heard = Heard::new();
            heard.oldest = Mark { at: start, serial };
            heard.end = heard.oldest;
            let (mut model, mut kept, mut lost) = (VecDeque::new(), 0, 0);
            let mut mark = heard.end();
            let all = set(&[17]);
            for (tag, (sections, data, reads)) in (0..).zip(steps) {
                let frame = frame(&[&[17], &[18; 4][..sections.into()]].concat(), data, tag);
                heard.push(&frame);
                kept += LENGTH + frame.len();
                model.push_back(frame);
                while kept > HEARD {
                    let oldest: &Vec<u8> = model.front().expect("a frame");
                    kept -= LENGTH + oldest.len();
                    model.pop_front();
                    lost += 1;
                }
                // What was read is not lost, though it is kept.
                if reads {
                    if lost > 0 {
                        prop_assert_eq!(read(&heard, &mut mark, &all), Some(Err(lost)));
                        lost = 0;
                    }
                    let next = model.pop_front();
                    let expected = next.map(|frame| { kept -= LENGTH + frame.len(); Ok(frame) });
                    prop_assert_eq!(read(&heard, &mut mark, &all), expected);
                }
            }
        }
    }
}
