//! The line itself: events in the order of virtual time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

use puente_framed::Random;
use puente_line::{Instant, Settings};

use crate::heard::{Drive, Heard, Node};
use crate::judge::{Record, Rule, Rules, Violation};
use crate::medium::{Arrival, Receiver};
use crate::noise::Noise;

/// So often a station may ask to be polled again at the same time without doing anything.
const IDLE_POLLS: u32 = 100;

/// How a station notices that another is talking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// By the start bit, as a UART that can tell whether it is receiving.
    StartBit,
    /// By whole characters.
    Character,
}

/// A station's place on the line, and its transceiver.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Time that a signal takes from the line's end to here.
    pub position: Duration,
    /// Shortest time from a station's decision to its first bit on the line.
    pub turnaround: Duration,
    /// At most so much is added to it, at random.
    pub jitter: Duration,
    /// How it notices others.
    pub sense: Sense,
    /// It hears nothing.
    pub deaf: bool,
    /// Its manners are watched.
    pub judged: bool,
}

impl Place {
    /// At a line's beginning, a transceiver that takes 1 to 2 bit times at `line`'s rate, start bits noticed, judged.
    pub fn new(line: Settings) -> Self {
        let bit = Duration::from_nanos(bit_time(line));
        Self {
            position: Duration::ZERO,
            turnaround: bit,
            jitter: bit,
            sense: Sense::StartBit,
            deaf: false,
            judged: true,
        }
    }
}

/// What has been on a line so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Characters sent, by all stations together.
    pub characters: u64,
    /// Their bits: start, data, parity and stop.
    pub bits: u64,
    /// Characters that a receiver had to take while another signal was there.
    pub spoiled: u64,
    /// Bits that noise has turned round, at all receivers together.
    pub flipped: u64,
}

/// A line with its stations.
pub struct Line<N> {
    now: u64,
    bit: u64,
    character: u64,
    format_bits: u32,
    rules: Rules,
    random: Random,
    noise: Noise,
    seats: Vec<Seat<N>>,
    on_the_way: BinaryHeap<Reverse<(u64, u64, usize, u8)>>,
    order: u64,
    longest_way: u64,
    shortcut: bool,
    totals: Totals,
}

struct Seat<N> {
    node: N,
    place: Place,
    receiver: Receiver,
    record: Record,
    /// When the station wants to be polled; `u64::MAX` for never.
    wake: u64,
    idle_polls: u32,
    talk: Option<Talk>,
}

/// What a station is sending.
struct Talk {
    bytes: Vec<u8>,
    /// The next byte to begin.
    next: usize,
    /// When it begins, or, after the last, when that ends.
    at: u64,
    jam: bool,
    /// The byte begun last.
    last: u8,
}

#[derive(Clone, Copy)]
enum Event {
    /// A receiver has taken a character.
    End(usize),
    /// A start bit reaches a receiver.
    Arrival,
    /// A station is polled.
    Wake(usize),
    /// A transmitter begins a character, or has ended its last.
    Begin(usize),
}

impl<N: Node> Line<N> {
    /// A line on which stations leave `gap`, with `noise` the probability that a receiver hears a bit wrong.
    pub fn new(line: Settings, gap: Duration, noise: f64, seed: u64) -> Self {
        let bit = bit_time(line);
        Self {
            now: 0,
            bit,
            character: bit * u64::from(line.format.bits()),
            format_bits: line.format.bits(),
            rules: Rules { gap: gap.as_nanos() as u64 },
            random: Random::new(seed),
            noise: Noise::new(noise, seed ^ 0xA5A5),
            seats: Vec::new(),
            on_the_way: BinaryHeap::new(),
            order: 0,
            longest_way: 0,
            shortcut: true,
            totals: Totals::default(),
        }
    }

    /// Puts a station onto the line; gives its place in [`Line::node`].
    pub fn join(&mut self, node: N, place: Place) -> usize {
        let (receiver, record) = (Receiver::default(), Record::default());
        let wake = self.now;
        self.seats.push(Seat { node, place, receiver, record, wake, idle_polls: 0, talk: None });
        let positions = || self.seats.iter().map(|seat| seat.place.position);
        let way = positions().max().unwrap_or_default() - positions().min().unwrap_or_default();
        self.longest_way = way.as_nanos() as u64;
        self.seats.len() - 1
    }

    /// A station.
    pub fn node(&self, station: usize) -> &N {
        &self.seats[station].node
    }

    /// Every station.
    pub fn nodes(&self) -> impl Iterator<Item = &N> {
        self.seats.iter().map(|seat| &seat.node)
    }

    /// A station, to be told something; it is polled then.
    pub fn tell(&mut self, station: usize) -> &mut N {
        self.seats[station].wake = self.now;
        &mut self.seats[station].node
    }

    /// The place of a station, to break it or to mend it.
    pub fn place(&mut self, station: usize) -> &mut Place {
        &mut self.seats[station].place
    }

    /// Lets every character take the long way, which is what the short one is measured by.
    pub fn without_shortcut(mut self) -> Self {
        self.shortcut = false;
        self
    }

    /// The virtual time.
    pub fn now(&self) -> Instant {
        micros(self.now)
    }

    /// What has been on the line.
    pub fn totals(&self) -> Totals {
        Totals { flipped: self.noise.flipped, ..self.totals }
    }

    /// Goes on until `time`.
    ///
    /// # Errors
    /// The first [`Violation`] of a station that is judged; the line is of no use then.
    pub fn run_until(&mut self, time: Instant) -> Result<(), Violation> {
        let until = time.as_micros().saturating_mul(1_000);
        while let Some((at, event)) = self.next_event() {
            if at > until {
                break;
            }
            self.now = self.now.max(at);
            match event {
                Event::End(station) => self.end(station),
                Event::Arrival => self.arrive(),
                Event::Wake(station) => self.poll(station)?,
                Event::Begin(station) => self.begin(station)?,
            }
        }
        self.now = self.now.max(until);
        Ok(())
    }

    /// What happens next. Of what happens at the same time, the ends of characters come first and their beginnings last.
    fn next_event(&self) -> Option<(u64, Event)> {
        let mut next = (u64::MAX, Event::Arrival);
        for (station, seat) in self.seats.iter().enumerate() {
            if let Some(at) = seat.receiver.until()
                && at < next.0
            {
                next = (at, Event::End(station));
            }
        }
        if let Some(Reverse((at, ..))) = self.on_the_way.peek()
            && *at < next.0
        {
            next = (*at, Event::Arrival);
        }
        for (station, seat) in self.seats.iter().enumerate() {
            if seat.wake < next.0 {
                next = (seat.wake, Event::Wake(station));
            }
        }
        for (station, seat) in self.seats.iter().enumerate() {
            if let Some(talk) = &seat.talk
                && talk.at < next.0
            {
                next = (talk.at, Event::Begin(station));
            }
        }
        (next.0 < u64::MAX).then_some(next)
    }

    /// A transmitter begins its next character, or is done.
    fn begin(&mut self, station: usize) -> Result<(), Violation> {
        let now = self.now;
        let seat = &mut self.seats[station];
        let Some(talk) = &mut seat.talk else {
            return Ok(());
        };
        let Some(&byte) = talk.bytes.get(talk.next) else {
            seat.talk = None;
            seat.record.ends();
            return Ok(());
        };
        talk.next += 1;
        talk.last = byte;
        talk.at = now + self.character;
        if seat.place.judged {
            seat.record.begins().map_err(|rule| Violation { station, at: now, rule })?;
        }
        self.totals.characters += 1;
        self.totals.bits += u64::from(self.format_bits);
        if self.is_alone(station) {
            self.carry_at_once(station, byte);
            return Ok(());
        }
        let from = self.seats[station].place.position;
        for (to, seat) in self.seats.iter().enumerate() {
            let at = now + way(from, seat.place.position);
            self.order += 1;
            self.on_the_way.push(Reverse((at, self.order, to, byte)));
        }
        Ok(())
    }

    /// Whether nothing else happens until everybody has heard the character that begins now.
    fn is_alone(&mut self, talker: usize) -> bool {
        let until = self.now + self.character + self.longest_way;
        let quiet = self.shortcut
            && self.on_the_way.is_empty()
            && self.seats.iter().enumerate().all(|(station, seat)| {
                seat.wake > until
                    && seat.receiver.until().is_none()
                    && (station == talker || seat.talk.as_ref().is_none_or(|talk| talk.at > until))
            });
        quiet && self.noise.pass(u64::from(self.format_bits) * self.seats.len() as u64)
    }

    /// The same as the other events together, for a character that meets no other: this is what makes long runs quick.
    fn carry_at_once(&mut self, talker: usize, byte: u8) {
        let from = self.seats[talker].place.position;
        for seat in &mut self.seats {
            let at = self.now + self.character + way(from, seat.place.position);
            seat.record.quiet_from = at;
            if !seat.place.deaf {
                seat.node.hear(micros(at), Heard::Byte(byte));
                seat.wake = wake(&seat.node, at);
            }
        }
    }

    /// A start bit reaches a receiver.
    fn arrive(&mut self) {
        if let Some(Reverse((at, _, to, byte))) = self.on_the_way.pop() {
            let seat = &mut self.seats[to];
            if seat.receiver.begin(Arrival { at, byte }, self.character, self.bit) {
                self.totals.spoiled += 1;
            }
            seat.record.carrier_from = seat.receiver.since();
        }
    }

    /// A receiver has taken a character.
    fn end(&mut self, station: usize) {
        let now = self.now;
        let seat = &mut self.seats[station];
        let Some(heard) = seat.receiver.end(self.character, self.bit, &mut self.random) else {
            return;
        };
        seat.record.carrier_from = seat.receiver.since();
        seat.record.quiet_from = now;
        let heard = disturbed(heard, self.noise.strike(self.format_bits), self.format_bits);
        if let Some(talk) = &seat.talk
            && !talk.jam
            && !seat.place.deaf
            && talk.next > 0
            && heard != Heard::Byte(talk.last)
        {
            seat.record.hears_collision();
        }
        if !seat.place.deaf {
            seat.node.hear(micros(now), heard);
            seat.wake = wake(&seat.node, now);
        }
    }

    /// A station may do something.
    fn poll(&mut self, station: usize) -> Result<(), Violation> {
        let now = self.now;
        let seat = &mut self.seats[station];
        let sense = match seat.place.sense {
            Sense::StartBit => self.bit,
            Sense::Character => self.character,
        };
        let carrier = seat.receiver.since().is_some_and(|from| from + self.bit <= now);
        if carrier && seat.place.sense == Sense::StartBit && !seat.place.deaf {
            seat.node.carrier(micros(now));
        }
        let violation = |rule| Violation { station, at: now, rule };
        seat.idle_polls += 1;
        while let Some(drive) = seat.node.poll(micros(now)) {
            seat.idle_polls = 0;
            if seat.place.judged {
                seat.record.decides(now, &drive, sense, self.rules).map_err(violation)?;
            }
            let jitter = seat.place.jitter.as_nanos() as u64;
            let jitter = (u64::from(self.random.next()) * jitter) >> 32;
            seat.drive(drive, now + seat.place.turnaround.as_nanos() as u64 + jitter);
        }
        seat.wake = wake(&seat.node, now);
        if seat.wake > now {
            seat.idle_polls = 0;
        }
        if seat.idle_polls > IDLE_POLLS { Err(violation(Rule::Spins)) } else { Ok(()) }
    }
}

impl<N> Seat<N> {
    /// Sends something, from `at` on if the transmitter is off.
    fn drive(&mut self, drive: Drive, at: u64) {
        match (drive, &mut self.talk) {
            (Drive::Transmit(bytes), Some(talk)) => talk.bytes.extend(bytes),
            (Drive::Transmit(bytes), None) => {
                self.talk = Some(Talk { bytes, next: 0, at, jam: false, last: 0 });
            }
            // Not even one character may have begun: then nothing is left of them.
            (Drive::Jam(bytes), Some(talk)) => *talk = Talk { bytes, next: 0, jam: true, ..*talk },
            (Drive::Jam(bytes), None) => {
                self.talk = Some(Talk { bytes, next: 0, at, jam: true, last: 0 });
            }
        }
    }
}

/// What noise makes of a character: bit 0 is the start bit, the data follow, lowest first.
fn disturbed(heard: Heard, mask: u32, bits: u32) -> Heard {
    let data = mask >> 1 & 0xFF;
    match heard {
        // Parity and stop bits follow the data.
        Heard::Byte(_) if mask & 1 != 0 || (bits > 9 && mask >> 9 != 0) => Heard::Damaged,
        Heard::Byte(byte) => Heard::Byte(byte ^ data as u8),
        Heard::Damaged => Heard::Damaged,
    }
}

fn wake<N: Node>(node: &N, now: u64) -> u64 {
    node.poll_at().map_or(u64::MAX, |at| at.as_micros().saturating_mul(1_000).max(now))
}

fn way(from: Duration, to: Duration) -> u64 {
    from.abs_diff(to).as_nanos() as u64
}

fn micros(nanos: u64) -> Instant {
    Instant::from_micros(nanos / 1_000)
}

fn bit_time(line: Settings) -> u64 {
    1_000_000_000 / u64::from(line.baud.max(1))
}
