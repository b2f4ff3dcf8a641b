//! What a station must not do.

use std::fmt;
use std::time::Duration;

use puente_framed::arbiter::JAM;
use puente_framed::frame::MAX_FRAME;

use crate::heard::Drive;

/// Characters that a station may still begin after it has heard a collision, besides the jam: the one that it is told of the
/// collision in.
const AFTER_COLLISION: u32 = 1;

/// A rule was broken. Times are virtual, in nanoseconds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Which station, by its place in the line.
    pub station: usize,
    /// When.
    pub at: u64,
    /// What it did.
    pub rule: Rule,
}

/// What must not be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// It began to talk while it could hear another.
    CarrierIgnored,
    /// It began to talk too soon after the last character.
    NoGap {
        /// Silence that it left.
        silence: Duration,
    },
    /// It went on after it had heard a collision.
    CollisionIgnored,
    /// Its jam is not four times AA.
    Jam,
    /// It talks longer than the longest frame.
    Endless,
    /// It wants to be asked again at once, and does nothing.
    Spins,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "station {} at {} ns ", self.station, self.at)?;
        match self.rule {
            Rule::CarrierIgnored => f.write_str("talks although it hears another"),
            Rule::NoGap { silence } => write!(f, "talks after {silence:?}: no gap"),
            Rule::CollisionIgnored => f.write_str("goes on after a collision"),
            Rule::Jam => f.write_str("does not jam with 4 x AA"),
            Rule::Endless => f.write_str("talks without an end"),
            Rule::Spins => f.write_str("wants to be polled again at once, for ever"),
        }
    }
}

impl std::error::Error for Violation {}

/// What is known of one station.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Record {
    /// When the last character ended here.
    pub quiet_from: u64,
    /// Since when a character has been arriving.
    pub carrier_from: Option<u64>,
    /// It has heard a collision while it talked, and has begun so many characters since.
    after_collision: Option<u32>,
    /// Characters without a pause.
    run: usize,
}

/// The rules in numbers, in nanoseconds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    pub gap: u64,
}

impl Record {
    /// It decides to do something. `sense` is how long a character must have been arriving for the station to know.
    pub fn decides(&mut self, now: u64, drive: &Drive, sense: u64, rules: Rules) -> Result<(), Rule> {
        match drive {
            Drive::Transmit(bytes) => {
                self.run = 0;
                self.after_collision = None;
                if self.carrier_from.is_some_and(|from| from + sense <= now) {
                    return Err(Rule::CarrierIgnored);
                }
                // A microsecond less, for the station counts in whole ones.
                let silence = now.saturating_sub(self.quiet_from);
                if silence + 1_000 < rules.gap {
                    return Err(Rule::NoGap { silence: Duration::from_nanos(silence) });
                }
                if bytes.len() > MAX_FRAME { Err(Rule::Endless) } else { Ok(()) }
            }
            Drive::Jam(bytes) => {
                self.after_collision = None;
                if bytes[..] == JAM { Ok(()) } else { Err(Rule::Jam) }
            }
            Drive::Discard => Ok(()),
        }
    }

    /// It has heard what it did not say, while it talked.
    pub fn hears_collision(&mut self) {
        self.after_collision.get_or_insert(0);
    }

    /// It begins a character.
    pub fn begins(&mut self) -> Result<(), Rule> {
        self.run += 1;
        if self.run > MAX_FRAME + 1 + JAM.len() {
            return Err(Rule::Endless);
        }
        match &mut self.after_collision {
            Some(count) if *count >= AFTER_COLLISION => Err(Rule::CollisionIgnored),
            Some(count) => {
                *count += 1;
                Ok(())
            }
            None => Ok(()),
        }
    }

    /// It has stopped.
    pub fn ends(&mut self) {
        self.after_collision = None;
    }
}
