//! What a receiver makes of the characters that reach it, one or several at a time.

use puente_framed::Random;

use crate::heard::Heard;

/// A character on its way to a receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arrival {
    /// When its start bit gets there.
    pub at: u64,
    pub byte: u8,
}

/// The receiver of one station: it takes one character at a time, and whatever else comes meanwhile spoils it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Receiver {
    taking: Option<Taking>,
    /// Until when there is a signal.
    signal_until: u64,
}

#[derive(Clone, Copy, Debug)]
struct Taking {
    from: u64,
    until: u64,
    byte: u8,
    spoiled: bool,
}

impl Receiver {
    /// Since when a character has been arriving.
    pub fn since(&self) -> Option<u64> {
        self.taking.map(|taking| taking.from)
    }

    /// When the character that is arriving ends.
    pub fn until(&self) -> Option<u64> {
        self.taking.map(|taking| taking.until)
    }

    /// A start bit is here; a character takes `character`, a bit `bit`. True if it spoils another.
    pub fn begin(&mut self, arrival: Arrival, character: u64, bit: u64) -> bool {
        let Arrival { at, byte } = arrival;
        self.signal_until = self.signal_until.max(at + character);
        match &mut self.taking {
            // Two that say the same at the same time are not told apart.
            Some(taking) if taking.byte == byte && at < taking.from + bit / 2 && !taking.spoiled => false,
            Some(taking) => {
                taking.spoiled = true;
                true
            }
            None => {
                self.taking = Some(Taking { from: at, until: at + character, byte, spoiled: false });
                false
            }
        }
    }

    /// The character that was arriving ends; what was it?
    pub fn end(&mut self, character: u64, bit: u64, random: &mut Random) -> Option<Heard> {
        let taking = self.taking.take()?;
        // What is left of the other signal looks like another character.
        if self.signal_until > taking.until + bit {
            let until = self.signal_until.min(taking.until + character);
            self.taking = Some(Taking { from: taking.until, until, byte: 0, spoiled: true });
        }
        Some(match taking.spoiled {
            false => Heard::Byte(taking.byte),
            true if random.bits(1) == 0 => Heard::Damaged,
            true => Heard::Byte(random.bits(8) as u8),
        })
    }
}
