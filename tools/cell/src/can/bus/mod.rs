//! A CAN bus (ISO 11898-1) in virtual time.
//!
//! Frames take the bits they have, stuff bits and intermission included; among frames that begin together the dominant
//! identifier wins; a frame that nobody acknowledges, or that is struck, is followed by an error frame and sent again, and the
//! error counters of its seat rise until the seat is off. What is left out: propagation, clocks that differ, bit errors that
//! only one receiver sees, and overload frames.

mod arbitration;
mod counters;
mod seat;

use std::time::Duration;

pub use counters::{Counters, State};
use puente_canopen::Frame;
use puente_framed::Random;
use puente_line::Instant;
pub use seat::Order;
use seat::Seat;

/// Superposed error flags of two nodes, delimiter, intermission: the longest error frame.
const ERROR_FRAME: u64 = 12 + 8 + 3;
/// Intermission, which [`Frame::bits`] counts: a frame has been heard before it.
const INTERMISSION: u64 = 3;
/// Acknowledgement delimiter, end of frame, intermission: what follows an acknowledgement that fails to come.
const AFTER_ACKNOWLEDGEMENT: u64 = 1 + 7 + INTERMISSION;
/// So long an error passive node lets others go first after a frame of its own.
const SUSPENSION: u64 = 8;
/// Frames that wait to be taken by a seat; of more the oldest go.
const INBOX: usize = 65_536;

/// Something that was on the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A frame, heard by all who are there but its sender.
    Frame(Sent),
    /// A frame that nobody heard, though it was acknowledged: its receivers were overrun.
    Dropped(Sent),
    /// A frame that was destroyed, or had no acknowledgement.
    Error {
        /// When it was given up.
        at: Instant,
        /// Its senders.
        senders: Vec<usize>,
    },
}

/// A frame that went over the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sent {
    /// When its last bit was over, without the intermission.
    pub at: Instant,
    /// It.
    pub frame: Frame,
    /// Its sender; more than one where several sent the same.
    pub senders: Vec<usize>,
    /// From when its sender wanted to send it until it began.
    pub waited: Duration,
}

/// A frame, and when it was heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// When.
    pub at: Instant,
    /// What.
    pub frame: Frame,
}

/// What has been on a bus so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Frames that went over it.
    pub frames: u64,
    /// Bits that were in use: frames with intermission, and error frames.
    pub bits: u64,
    /// Error frames.
    pub errors: u64,
    /// Frames of [`Totals::frames`] that nobody heard.
    pub dropped: u64,
    /// The longest time that a frame waited before it began for good.
    pub longest_wait: Duration,
}

/// What is on the bus now.
struct Current {
    senders: Vec<usize>,
    frame: Frame,
    begin: u64,
    /// When it has been heard, or has failed.
    end: u64,
    /// When the bus is free again.
    free: u64,
    /// Error of acknowledgement, which raises no counter of an error passive sender.
    fate: Fate,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Fate {
    Heard,
    Struck,
    NotAcknowledged,
}

/// A bus with its seats.
pub struct Bus {
    /// All times are nanoseconds.
    now: u64,
    bit: u64,
    free: u64,
    /// From when on the bus is idle, for those who count recessive bits.
    idle: u64,
    seats: Vec<Seat>,
    current: Option<Current>,
    drop: f64,
    errors: f64,
    random: Random,
    totals: Totals,
}

impl Bus {
    /// A bus at a bit rate, bit/s, at the start of the clock.
    pub fn new(bitrate: u32, seed: u64) -> Self {
        Self {
            now: 0,
            bit: 1_000_000_000 / u64::from(bitrate.max(1)),
            free: 0,
            idle: 0,
            seats: Vec::new(),
            current: None,
            drop: 0.0,
            errors: 0.0,
            random: Random::new(seed),
            totals: Totals::default(),
        }
    }

    /// A new seat; gives its number.
    pub fn join(&mut self, order: Order) -> usize {
        self.seats.push(Seat::new(order));
        self.seats.len() - 1
    }

    /// From now on frames are heard by nobody with this probability.
    pub fn set_drop(&mut self, probability: f64) {
        self.drop = probability;
    }

    /// From now on frames are destroyed, and sent again, with this probability.
    pub fn set_errors(&mut self, probability: f64) {
        self.errors = probability;
    }

    /// A seat that is not there neither sends nor hears nor acknowledges; what it wanted to send is forgotten.
    pub fn set_present(&mut self, seat: usize, present: bool) {
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.set_present(present);
        }
    }

    /// A seat sends a frame as often as the bus lets it, until a moment.
    pub fn babble(&mut self, seat: usize, frame: Frame, until: Instant) {
        let now = self.now;
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.babble(frame, now, nanos(until));
        }
    }

    /// A seat is off the bus from now on; it recovers by itself.
    pub fn switch_off(&mut self, seat: usize) {
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.counters.switch_off();
        }
    }

    /// A seat wants to send a frame from `now` on, after those that it already wants to.
    pub fn send(&mut self, now: Instant, seat: usize, frame: Frame) {
        let now = self.now.max(nanos(now));
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.send(now, frame);
        }
    }

    /// Forgets what a seat wants to send and has not begun.
    pub fn discard(&mut self, seat: usize) {
        let begun = self.current.as_ref().filter(|current| current.senders.contains(&seat));
        let begun = begun.map(|current| current.frame);
        if let Some(seat) = self.seats.get_mut(seat) {
            seat.discard(begun);
        }
    }

    /// Frames that a seat wants to send.
    pub fn pending(&self, seat: usize) -> usize {
        self.seats.get(seat).map_or(0, Seat::pending)
    }

    /// The next frame that a seat has heard.
    pub fn take(&mut self, seat: usize) -> Option<Heard> {
        self.seats.get_mut(seat)?.inbox.pop_front()
    }

    /// The error counters of a seat.
    pub fn counters(&self, seat: usize) -> Counters {
        self.seats.get(seat).map_or_else(Counters::default, |seat| seat.counters)
    }

    /// The longest time that a frame of a seat waited before it began for good.
    pub fn longest_wait(&self, seat: usize) -> Duration {
        self.seats.get(seat).map_or(Duration::ZERO, |seat| seat.longest_wait)
    }

    /// What has been on the bus.
    pub fn totals(&self) -> Totals {
        self.totals
    }

    /// When something happens next that nobody has to ask for.
    pub fn poll_at(&self) -> Option<Instant> {
        let next = match &self.current {
            Some(current) => Some(current.end),
            None => [self.next_begin(), self.next_recovery()].into_iter().flatten().min(),
        };
        next.map(|nanos| Instant::from_micros(nanos.div_ceil(1_000)))
    }

    /// The next thing that happens until a moment; whoever reacts to it does so before this is called again.
    pub fn step(&mut self, until: Instant) -> Option<Event> {
        let until = nanos(until);
        loop {
            if let Some(current) = self.current.take_if(|current| current.end <= until) {
                self.now = current.end;
                return Some(self.finish(current));
            }
            match self.next_begin() {
                Some(begin) if self.current.is_none() && begin <= until => self.begin(begin),
                _ => {
                    self.now = self.now.max(until);
                    if self.current.is_none() {
                        self.rest();
                    }
                    return None;
                }
            }
        }
    }

    /// When the next frame begins.
    fn next_begin(&self) -> Option<u64> {
        let ready = self.seats.iter().filter_map(|seat| seat.ready_at(self.free, self.idle, self.bit));
        ready.min().map(|at| at.max(self.free))
    }

    /// When the next seat that is off is on again, if nothing is sent until then.
    fn next_recovery(&self) -> Option<u64> {
        let off = self.seats.iter().map(|seat| seat.counters.recovers_in()).filter(|bits| *bits > 0);
        off.min().map(|bits| self.idle + bits * self.bit)
    }

    /// The bus has been idle until now.
    fn rest(&mut self) {
        let sequence = counters::RECESSIVE * self.bit;
        let sequences = self.now.saturating_sub(self.idle) / sequence;
        self.idle += sequences * sequence;
        for seat in &mut self.seats {
            seat.counters.recover(sequences);
        }
    }

    fn begin(&mut self, begin: u64) {
        self.now = begin;
        self.rest();
        let key = |(_, frame): &(usize, Frame)| arbitration::key(frame);
        let offers: Vec<(usize, Frame)> = self.offers(begin).collect();
        let Some(lowest) = offers.iter().map(key).min() else { return };
        let winners: Vec<_> = offers.into_iter().filter(|offer| key(offer) == lowest).collect();
        let Some(&(_, frame)) = winners.first() else { return };
        let differ = winners.iter().find_map(|(_, other)| arbitration::first_difference(&frame, other));
        let senders: Vec<_> = winners.into_iter().map(|(seat, _)| seat).collect();
        let bits = u64::from(frame.bits());
        let acknowledged =
            self.seats.iter().enumerate().any(|(at, seat)| seat.hears() && !senders.contains(&at));
        let struck = differ.map(u64::from).or_else(|| {
            let hit = chance(&mut self.random, self.errors);
            hit.then(|| u64::from(self.random.next()) % (bits - AFTER_ACKNOWLEDGEMENT))
        });
        let (end, free, fate) = match struck {
            Some(at) => (at, at + ERROR_FRAME, Fate::Struck),
            None if acknowledged => (bits - INTERMISSION, bits, Fate::Heard),
            None => {
                let at = bits - AFTER_ACKNOWLEDGEMENT;
                (at, at + ERROR_FRAME, Fate::NotAcknowledged)
            }
        };
        let at = |bits: u64| begin + bits * self.bit;
        self.totals.bits += free;
        self.current = Some(Current { senders, frame, begin, end: at(end), free: at(free), fate });
    }

    /// Who wants to send at a moment, and what.
    fn offers(&self, at: u64) -> impl Iterator<Item = (usize, Frame)> {
        let seats = self.seats.iter().enumerate();
        seats.filter_map(move |(number, seat)| {
            let ready = seat.ready_at(self.free, self.idle, self.bit).is_some_and(|ready| ready <= at);
            ready.then(|| seat.offer(at)).flatten().map(|frame| (number, frame))
        })
    }

    fn finish(&mut self, current: Current) -> Event {
        (self.free, self.idle) = (current.free, current.free);
        let at = Instant::from_micros(current.end.div_ceil(1_000));
        if current.fate != Fate::Heard {
            self.fail(&current);
            return Event::Error { at, senders: current.senders };
        }
        let dropped = chance(&mut self.random, self.drop);
        let mut waited = 0;
        for (number, seat) in self.seats.iter_mut().enumerate() {
            if current.senders.contains(&number) {
                waited = waited.max(seat.sent(&current.frame, current.begin, self.free, self.bit));
            } else if seat.hears() {
                seat.counters.received();
                if !dropped {
                    seat.hear(Heard { at, frame: current.frame });
                }
            }
            // Its last recessive bits.
            seat.counters.recover(1);
        }
        let waited = Duration::from_nanos(waited);
        self.totals.frames += 1;
        self.totals.dropped += u64::from(dropped);
        self.totals.longest_wait = self.totals.longest_wait.max(waited);
        let sent = Sent { at, frame: current.frame, senders: current.senders, waited };
        if dropped { Event::Dropped(sent) } else { Event::Frame(sent) }
    }

    fn fail(&mut self, current: &Current) {
        self.totals.errors += 1;
        for (number, seat) in self.seats.iter_mut().enumerate() {
            if current.senders.contains(&number) {
                seat.failed(current.fate == Fate::NotAcknowledged, self.free, self.bit);
            } else if seat.hears() {
                seat.counters.receive_error();
            }
            // Those of the delimiter and of the intermission.
            seat.counters.recover(1);
        }
    }
}

fn nanos(at: Instant) -> u64 {
    at.as_micros().saturating_mul(1_000)
}

fn chance(random: &mut Random, probability: f64) -> bool {
    probability > 0.0 && f64::from(random.next()) < probability * (f64::from(u32::MAX) + 1.0)
}
