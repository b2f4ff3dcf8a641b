//! The gateway's end: what it wants of the axes of a bus, and what they are at.

mod image;
mod types;

use core::time::Duration;

use heapless::Vec;
use puente_drives::pid::State;
use puente_framed::arbiter::{Failure, Precedence};
use puente_framed::frame::{EmitError, TAGGED_OVERHEAD};
use puente_framed::station::{self, PostError};
use puente_framed::{Class, Frame, Kind, Station, section};
use puente_line::{Instant, micros};

use crate::turns::Turns;
use crate::{Control, Report, event, setting};
use image::Image;
pub use types::{Action, Axis, Config, Output, Statistics};

/// Part of a cycle that its frame and its answers may take, in percent.
const SHARE: u64 = 80;

/// A gateway's station on a line with at most `AXES` modules of its own, with windows of `W` events to `PEERS` of them at a
/// time, best as many as there are modules. `N` is the longest frame that it takes or sends.
#[derive(Clone, Debug)]
pub struct Master<const AXES: usize, const PEERS: usize, const W: usize, const N: usize> {
    address: u8,
    cycle: Duration,
    gap: Duration,
    character: Duration,
    station: Station<0, PEERS, W, { event::BODY }, N>,
    turns: Turns,
    axes: Vec<Image, AXES>,
    phase: Phase,
    /// When the next cycle begins.
    due: Instant,
    /// The next cycle begins before that: somebody is to be stopped.
    hurry: bool,
    /// What is wanted has changed since the frame was made.
    changed: bool,
    /// Who is asked first in the next cycle.
    turn: usize,
    /// The frame that went last was a client's.
    client_went: bool,
    /// A client's frame was refused since: the next cycle lets it go first.
    client_waits: bool,
    fell: Option<(usize, Control)>,
    /// When the cycle's frame was ready to go.
    ready: Instant,
    /// When the last cycle's frame had ended.
    last: Option<Instant>,
    /// After a cycle another gateway may go first.
    rested_at: Instant,
    rest: Duration,
    /// When another gateway was heard last, or met.
    rival: Option<Instant>,
    /// Collisions by then.
    collisions: u32,
    statistics: Statistics,
}

/// So long after another gateway has been heard one keeps letting it go first.
const COMPANY: Duration = Duration::from_secs(1);

/// A cycle's frame.
const CYCLE: Kind = Kind::Single(Class::Data);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// For the next cycle.
    Waiting,
    /// The cycle's frame is in work.
    Sending,
    /// Answers may come until then.
    Answering(Instant),
}

impl<const AXES: usize, const PEERS: usize, const W: usize, const N: usize> Master<AXES, PEERS, W, N> {
    const LENGTHS: () = assert!(
        AXES * (section::OVERHEAD + setting::MAX_DATA) + TAGGED_OVERHEAD <= N,
        "a cycle's frame is longer than N"
    );

    /// A gateway's station that wants nothing yet; of more than `AXES` axes the rest are left out. Its seed must be another
    /// than that of any other station, and another at each start.
    pub fn new(config: Config, axes: impl IntoIterator<Item = Axis>, now: Instant, seed: u64) -> Self {
        const { Self::LENGTHS };
        let station = station::Config { promiscuous: true, ..config.station };
        Self {
            address: station.address,
            cycle: config.cycle,
            gap: station.arbiter.gap,
            character: station.arbiter.line.wire_time(1),
            station: Station::new(station, now, seed),
            turns: Turns::new(&station.arbiter),
            axes: axes.into_iter().take(AXES).map(Image::new).collect(),
            phase: Phase::Waiting,
            due: now,
            hurry: false,
            changed: false,
            turn: 0,
            client_went: false,
            client_waits: false,
            fell: None,
            ready: now,
            last: None,
            rested_at: now,
            rest: station.arbiter.rest,
            rival: None,
            collisions: 0,
            statistics: Statistics::default(),
        }
    }

    /// Says what is wanted of an axis from now on. A change towards standstill makes the next cycle due at once; it begins when
    /// the answers to the last one have come, or could have.
    pub fn set(&mut self, axis: usize, output: Output) {
        let Some(image) = self.axes.get_mut(axis) else { return };
        if image.output() == output {
            return;
        }
        self.hurry |= output.control.stops_after(image.output().control);
        image.set(output);
        self.changed = true;
    }

    /// What is wanted of an axis; the default for one that there is not.
    pub fn output(&self, axis: usize) -> Output {
        self.axes.get(axis).map(Image::output).unwrap_or_default()
    }

    /// Takes a client's whole frame; from origin 0 it goes as one of this station. Where it is `Busy`, try again after every
    /// poll: the line is free now and then between two cycles, at the latest after the next.
    ///
    /// # Errors
    /// Any [`PostError`].
    pub fn post(&mut self, now: Instant, frame: &[u8]) -> Result<(), PostError> {
        let cycles_turn = self.is_due(now) && self.client_went;
        self.client_waits = self.phase != Phase::Waiting || cycles_turn || !self.station.is_free();
        if self.client_waits {
            return Err(PostError::Busy);
        }
        self.station.post_frame(now, frame)?;
        self.client_went = true;
        Ok(())
    }

    /// Takes a byte that the line said, the echo of what is sent too, at its end. [`Master::poll`] until it is idle, before
    /// the next.
    pub fn receive(&mut self, now: Instant, byte: u8) {
        self.station.receive(now, byte);
    }

    /// The line reported a parity, framing or overrun error.
    pub fn line_error(&mut self, now: Instant) {
        self.station.line_error(now);
    }

    /// A character is arriving; see [`puente_framed::Arbiter::carrier`].
    pub fn carrier(&mut self, now: Instant) {
        self.station.carrier(now);
    }

    /// What to do now.
    pub fn poll(&mut self, now: Instant) -> Action<'_> {
        loop {
            if let Some((axis, to)) = self.fell.take() {
                return Action::Fell { axis, to };
            }
            if let Some(axis) = self.missed(now) {
                return Action::Missed { axis };
            }
            self.cycle(now);
            match self.station.poll(now) {
                station::Action::Transmit(_) => {
                    self.transmit(now);
                    return Action::Transmit(self.station.sent());
                }
                station::Action::Jam(bytes) => return Action::Jam(bytes),
                station::Action::Idle => return Action::Idle,
                station::Action::Heard(frame) => {
                    let report = report_of(&frame, self.address, &self.axes);
                    if matches!(frame.kind, Kind::Plain | Kind::Single(Class::Data)) {
                        self.rival = Some(now);
                    }
                    return match report {
                        Some((axis, report)) => self.reported(now, axis, report),
                        None => Action::Heard(self.station.heard()),
                    };
                }
                station::Action::Received { from, class: Class::Event, body } => {
                    let told = section::Sections::new(body).next().and_then(|told| event::parse(told.data));
                    let axis = self.axes.iter().position(|image| image.axis.address == from);
                    if let (Some(axis), Some(event)) = (axis, told) {
                        return Action::Event { axis, event };
                    }
                }
                station::Action::Posted(outcome) if self.phase == Phase::Sending => {
                    self.sent(now, outcome);
                    if outcome.is_err() {
                        return Action::Failed;
                    }
                }
                station::Action::Posted(outcome) => return Action::Posted(outcome),
                _ => {}
            }
        }
    }

    /// The frame of the last [`Action::Transmit`]: it stays here until it is off the line.
    pub fn sending(&self) -> &[u8] {
        self.station.sent()
    }

    /// When to poll again, besides after everything that is told to the master.
    pub fn poll_at(&self) -> Option<Instant> {
        let own = match self.phase {
            _ if self.fell.is_some() => Some(Instant::ZERO),
            Phase::Answering(until) => Some(until),
            Phase::Waiting if self.station.is_free() && !self.axes.is_empty() => Some(self.begins_at()),
            Phase::Sending if self.changed && self.station.is_waiting() => Some(Instant::ZERO),
            _ => None,
        };
        [self.station.poll_at(), own].into_iter().flatten().min()
    }

    /// What has happened since start-up.
    pub fn statistics(&self) -> Statistics {
        Statistics { line: self.station.statistics(), ..self.statistics }
    }

    /// When the next cycle begins.
    fn begins_at(&self) -> Instant {
        let due = if self.hurry { Instant::ZERO } else { self.due };
        due.max(self.rested_at)
    }

    fn is_due(&self, now: Instant) -> bool {
        !self.axes.is_empty() && self.begins_at() <= now
    }

    /// Begins a cycle that is due, or has one that is waiting for the line say what is wanted now.
    fn cycle(&mut self, now: Instant) {
        match self.phase {
            Phase::Sending if self.changed => self.renew(now),
            // It is asked for again now, or not at all.
            Phase::Waiting if self.client_waits && !self.client_went && !self.hurry => {
                self.client_waits = false;
            }
            Phase::Waiting if self.is_due(now) && self.station.is_free() => {
                self.ask();
                let axes = &self.axes;
                if self.station.post_with(now, Precedence::Ordinary, CYCLE, |body| write(axes, body)).is_ok()
                {
                    self.phase = Phase::Sending;
                    self.ready = now;
                    self.written();
                }
                // What is late stays on the grid, unless it is late by a cycle.
                let next = self.due + self.cycle;
                self.due = if self.due <= now && now < next { next } else { now + self.cycle };
            }
            _ => {}
        }
    }

    /// Has the cycle's frame say what is wanted now. Where it is on the line already, the next one does, or this one should it
    /// collide.
    fn renew(&mut self, now: Instant) {
        let axes = &self.axes;
        if self.station.repost(now, CYCLE, |body| write(axes, body)) {
            self.written();
        }
    }

    /// The cycle's frame goes. If it had to wait for the line, all that follow come later by as much: so the cycles of two
    /// gateways find places of their own instead of meeting again and again.
    fn transmit(&mut self, now: Instant) {
        if self.phase == Phase::Sending {
            self.due += now.since(self.ready);
            self.ready = now;
        }
    }

    /// The frame in work says what is wanted now.
    fn written(&mut self) {
        self.axes.iter_mut().for_each(Image::written);
        self.changed = false;
        self.hurry = false;
        self.client_went = false;
    }

    /// Chooses who is asked in the next cycle.
    fn ask(&mut self) {
        let count = self.axes.len();
        let asked = self.asked();
        for (at, image) in self.axes.iter_mut().enumerate() {
            // How far behind the first one.
            image.ask = (at + count - self.turn) % count.max(1) < asked;
        }
        self.turn = (self.turn + asked) % count.max(1);
    }

    /// How many modules there is time to ask.
    fn asked(&self) -> usize {
        let count = self.axes.len();
        if self.cycle.is_zero() {
            return count;
        }
        let sections = self.axes.iter().map(|image| section::OVERHEAD + image.data(false).len());
        let frame = sections.sum::<usize>() + TAGGED_OVERHEAD;
        let share = Duration::from_micros(micros(self.cycle).saturating_mul(SHARE) / 100);
        let frame = self.gap.saturating_add(self.character.saturating_mul(frame as u32));
        self.turns.reports_in(share.saturating_sub(frame)).clamp(1, count)
    }

    /// The cycle's frame is off the line.
    fn sent(&mut self, now: Instant, outcome: Result<(), Failure>) {
        self.statistics.failure = outcome.err();
        if outcome.is_err() {
            count(&mut self.statistics.failed);
            return self.end_cycle(now);
        }
        count(&mut self.statistics.cycles);
        if let Some(last) = self.last.replace(now) {
            self.statistics.last_cycle = now.since(last);
            self.statistics.longest_cycle = self.statistics.longest_cycle.max(now.since(last));
        }
        let mut asked = 0;
        for image in self.axes.iter_mut().filter(|image| image.ask) {
            image.told();
            asked += 1;
        }
        self.phase = Phase::Answering(self.turns.reports_until(now, asked));
    }

    /// Gives one that was asked in this cycle and has not answered in time; ends the cycle when there is none.
    fn missed(&mut self, now: Instant) -> Option<usize> {
        let Phase::Answering(until) = self.phase else { return None };
        if now < until {
            return None;
        }
        let missed = self.axes.iter().position(|image| image.ask);
        match missed.and_then(|at| self.axes.get_mut(at)) {
            Some(image) => {
                image.ask = false;
                count(&mut self.statistics.missed);
            }
            None => self.end_cycle(now),
        }
        missed
    }

    fn end_cycle(&mut self, now: Instant) {
        self.phase = Phase::Waiting;
        if now > self.due && !self.cycle.is_zero() {
            count(&mut self.statistics.overruns);
        }
        // One that has not got a word in yet is met, if not heard.
        let collisions = self.station.statistics().collisions;
        if core::mem::replace(&mut self.collisions, collisions) != collisions {
            self.rival = Some(now);
        }
        if self.rival.is_some_and(|last| now.since(last) < COMPANY) {
            self.rested_at = now + self.rest;
        }
    }

    fn reported(&mut self, now: Instant, axis: usize, report: Report) -> Action<'_> {
        let mut current = false;
        if let Some(image) = self.axes.get_mut(axis) {
            let meaning = image.reported(report);
            current = meaning.current;
            if let Some(to) = meaning.fell {
                self.changed = true;
                self.fell = Some((axis, to));
            }
            // Another is already being asked for where the cycle's frame is in work.
            image.ask &= self.phase == Phase::Sending;
        }
        if matches!(self.phase, Phase::Answering(_)) && !self.axes.iter().any(|image| image.ask) {
            self.end_cycle(now);
        }
        Action::Reported { axis, report, current }
    }
}

/// The report that a frame is, of an axis that was asked.
fn report_of(frame: &Frame<'_>, address: u8, axes: &[Image]) -> Option<(usize, Report)> {
    if frame.kind != Kind::Single(Class::Status) || frame.destination() != address {
        return None;
    }
    let asked = |image: &Image| image.axis.address == frame.origin && image.owes();
    let axis = axes.iter().position(asked)?;
    Some((axis, Report::parse(frame.section_for(address)?.data)?))
}

/// The sections of a cycle's frame.
fn write<const N: usize>(axes: &[Image], body: &mut Vec<u8, N>) -> Result<(), EmitError> {
    for image in axes {
        section::push(body, image.axis.address, &image.data(image.ask))?;
    }
    Ok(())
}

/// Whether an axis is under current.
const fn is_under_current(state: State) -> bool {
    matches!(state, State::Starting | State::Enabled | State::Held)
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
