//! The line itself: events in the order of virtual time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::time::Duration;

use puente_framed::Random;
use puente_line::{Instant, Settings};

use crate::heard::{Heard, Node};
use crate::judge::{Rule, Rules, Violation};
use crate::medium::Arrival;
use crate::noise::Noise;
use crate::seat::{Place, Seat, Sense, bit_time};

/// So often a station may ask to be polled again at the same time without doing anything.
const IDLE_POLLS: u32 = 100;

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
    /// Until when it is known what happens: from then on somebody outside may tell a station something.
    horizon: u64,
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
            horizon: 0,
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
        self.seats.push(Seat::new(node, place, self.now));
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

    /// A station, to take something from it; it is not polled for that.
    pub fn node_mut(&mut self, station: usize) -> &mut N {
        &mut self.seats[station].node
    }

    /// The place of a station, to break it or to mend it.
    pub fn place(&mut self, station: usize) -> &mut Place {
        &mut self.seats[station].place
    }

    /// Whether a character is arriving at a station, for a bit at least.
    pub fn carrier(&self, station: usize) -> bool {
        self.seats[station].receiver.since().is_some_and(|from| from + self.bit <= self.now)
    }

    /// Bytes of a station that have not begun.
    pub fn pending(&self, station: usize) -> usize {
        self.seats[station].talk.as_ref().map_or(0, |talk| talk.bytes.len())
    }

    /// From now on noise turns each bit that a receiver hears round with this probability.
    pub fn set_noise(&mut self, probability: f64) {
        self.noise.set(probability);
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

    /// When something happens next, at the earliest; [`Line::run_until`] then.
    pub fn poll_at(&self) -> Option<Instant> {
        self.next_event().map(|(at, _)| Instant::from_micros(at.div_ceil(1_000)))
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
        self.horizon = until;
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
        let Some(byte) = talk.bytes.pop_front() else {
            seat.talk = None;
            seat.record.ends();
            return Ok(());
        };
        talk.last = Some(byte);
        talk.at = now + self.character;
        if seat.place.judged {
            seat.record.begins().map_err(|rule| Violation { station, at: now, rule })?;
        }
        if seat.place.mute {
            return Ok(());
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
            && until <= self.horizon
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
            if seat.listens() {
                seat.node.hear(micros(at), Heard::Byte(byte));
                seat.wake_after(at);
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
            && talk.last.is_some_and(|last| heard != Heard::Byte(last))
        {
            seat.record.hears_collision();
        }
        if seat.listens() {
            seat.node.hear(micros(now), heard);
            seat.wake_after(now);
        }
    }

    /// A station may do something.
    fn poll(&mut self, station: usize) -> Result<(), Violation> {
        let now = self.now;
        let carrier = self.carrier(station);
        let seat = &mut self.seats[station];
        let sense = match seat.place.sense {
            Sense::StartBit => self.bit,
            Sense::Character => self.character,
        };
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
        seat.wake_after(now);
        if seat.wake > now {
            seat.idle_polls = 0;
        }
        if seat.idle_polls > IDLE_POLLS { Err(violation(Rule::Spins)) } else { Ok(()) }
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

fn way(from: Duration, to: Duration) -> u64 {
    from.abs_diff(to).as_nanos() as u64
}

fn micros(nanos: u64) -> Instant {
    Instant::from_micros(nanos / 1_000)
}
