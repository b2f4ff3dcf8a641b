//! A member: what is known of it, and when it is tried.

use core::time::Duration;

use puente_line::Instant;

use super::types::{Evidence, Health, Member};
use crate::boot::{Signs, Verdict};
use crate::monitor::{self, Supervision};
use crate::nmt::{Command, State};
use crate::sdo::Failure;
use crate::{Frame, Monitor};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Absent,
    Booting,
    Booted,
    Lost,
    Refused,
}

#[derive(Clone, Debug)]
pub(super) struct Managed<'a> {
    pub member: Member<'a>,
    pub monitor: Monitor,
    phase: Phase,
    /// When it is tried; whether it is known to be there.
    attempt: Option<(Instant, bool)>,
    /// It is due, and there was no channel.
    waits: bool,
    /// The state that it was led to.
    expected: Option<State>,
    /// Since when it says another one.
    astray: Option<Instant>,
    verdict: Option<Verdict>,
    told_missing: bool,
    /// Times that it was configured or judged in vain since it was well.
    vain: u8,
    /// When it was booted last.
    booted: Instant,
    /// Since when its heartbeats are counted, and how many came.
    beats: (Instant, u8),
}

/// A member that was configured in vain is tried again later and later, up to so many doublings: there are drives that keep
/// each value written to them in a memory that wears.
const DOUBLINGS: u8 = 6;
/// Within so many periods so many heartbeats are of two nodes.
const PERIODS: u32 = 8;
const BEATS: u8 = 14;

impl<'a> Managed<'a> {
    pub fn new(member: Member<'a>, now: Instant) -> Self {
        Self {
            monitor: Monitor::new(member.id, Supervision::Off, now),
            member,
            phase: Phase::Absent,
            attempt: None,
            waits: false,
            expected: None,
            astray: None,
            verdict: None,
            told_missing: false,
            vain: 0,
            booted: now,
            beats: (now, 0),
        }
    }

    pub const fn health(&self) -> Health {
        match (self.phase, self.verdict) {
            (Phase::Absent, _) => Health::Absent,
            // It is tried again; why it was not booted is still of interest.
            (Phase::Booting | Phase::Refused, Some(verdict)) => Health::Refused(verdict),
            (Phase::Booting | Phase::Refused, None) => Health::Booting,
            (Phase::Booted, _) => Health::Booted,
            (Phase::Lost, _) => Health::Lost,
        }
    }

    pub const fn is_booted(&self) -> bool {
        matches!(self.phase, Phase::Booted)
    }

    /// It is tried at `at`, unless it is tried earlier anyway.
    pub fn attempt(&mut self, at: Instant, present: bool) {
        let (earlier, known) = self.attempt.unwrap_or((at, false));
        self.attempt = Some((earlier.min(at), known || present));
        self.waits = false;
    }

    /// It is tried now, if there is a channel for it.
    pub fn is_due(&self, now: Instant) -> bool {
        self.attempt.is_some_and(|(at, _)| at <= now)
    }

    pub const fn waits(&self) -> bool {
        self.waits && self.attempt.is_some()
    }

    /// There is no channel for it now.
    pub const fn wait(&mut self) {
        self.waits = true;
    }

    /// It is tried: whether it is known to be there.
    pub fn try_now(&mut self) -> bool {
        self.waits = false;
        let present = self.attempt.take().is_some_and(|(_, present)| present);
        if present {
            self.present();
        }
        present
    }

    /// How long it is left alone.
    fn patience(&self, retry: Duration) -> Duration {
        retry.saturating_mul(1 << self.vain.min(DOUBLINGS))
    }

    /// It answers.
    pub fn present(&mut self) {
        self.phase = Phase::Booting;
        self.astray = None;
    }

    /// It did not answer: whether that is to be told.
    pub fn absent(&mut self, next: Instant) -> bool {
        self.attempt(next, false);
        let silent = matches!(self.verdict, Some(Verdict::Failed { failure: Failure::Timeout { .. }, .. }));
        match self.phase {
            // That it does not answer is known already.
            Phase::Lost => {}
            Phase::Refused if silent => {}
            _ => self.phase = Phase::Absent,
        }
        let tell = !self.member.optional && !self.told_missing && self.phase == Phase::Absent;
        self.told_missing |= tell;
        tell
    }

    pub fn booted(&mut self, now: Instant) {
        self.phase = Phase::Booted;
        self.booted = now;
        self.verdict = None;
        self.told_missing = false;
        self.attempt = None;
        self.astray = None;
        self.monitor.watch(now, self.member.supervision);
    }

    /// Whether the verdict is to be told.
    pub fn refused(&mut self, now: Instant, verdict: Verdict, retry: Duration) -> bool {
        self.phase = Phase::Refused;
        self.attempt(now + self.patience(retry), false);
        self.vain = DOUBLINGS.min(self.vain + 1);
        self.verdict.replace(verdict) != Some(verdict)
    }

    /// A command was given to it, by whomever.
    pub fn commanded(&mut self, now: Instant, command: Command, retry: Duration) {
        self.astray = None;
        match command {
            Command::ResetNode | Command::ResetCommunication => {
                self.forget(now);
                // Unless it boots before.
                self.attempt(now + retry, false);
            }
            _ => self.expected = Some(command.leads_to()),
        }
    }

    /// All that was told to it, is gone.
    fn forget(&mut self, now: Instant) {
        self.phase = Phase::Absent;
        self.expected = None;
        self.astray = None;
        self.verdict = None;
        self.told_missing = false;
        self.attempt = None;
        self.vain = 0;
        self.monitor.forget(now);
    }

    /// Its attempt is dropped where it was in work: whoever was at it is not any more.
    pub fn interrupted(&mut self, next: Instant) {
        if self.phase == Phase::Booting {
            self.phase = Phase::Absent;
        }
        self.attempt(next, false);
    }

    /// Takes a sign of it: whether it can be of one node alone.
    pub fn receive(&mut self, now: Instant, frame: &Frame, retry: Duration) -> Option<Evidence> {
        self.monitor.receive(now, frame);
        self.check(now, retry);
        self.beat(now)
    }

    /// It has shown itself: whether it does so too often.
    fn beat(&mut self, now: Instant) -> Option<Evidence> {
        let Signs::Heartbeat(period @ 1..) = self.member.plan.signs else {
            return None;
        };
        let window = Duration::from_millis(u64::from(period)) * PERIODS;
        let (since, count) = self.beats;
        // Before it is booted it may have another period.
        if self.phase != Phase::Booted || now >= since + window {
            self.beats = (now, 1);
            return None;
        }
        self.beats = (since, count.saturating_add(1));
        (count.saturating_add(1) >= BEATS).then_some(Evidence::Heartbeat)
    }

    fn check(&mut self, now: Instant, retry: Duration) {
        // Whoever was led to a state and says another one for a while is led there anew.
        match (self.phase, self.monitor.state(), self.expected) {
            (Phase::Booted, Some(is), Some(expected)) if is != expected => {
                let since = *self.astray.get_or_insert(now);
                if since >= self.booted + retry.saturating_mul(1 << DOUBLINGS) {
                    self.vain = 0;
                }
                if now >= since + self.patience(retry) && !self.is_due(now) {
                    self.vain = DOUBLINGS.min(self.vain + 1);
                    self.attempt(now, true);
                }
            }
            _ => self.astray = None,
        }
    }

    /// What its monitor has told.
    pub fn heard(&mut self, now: Instant, event: monitor::Event, retry: Duration) {
        match (event, self.phase) {
            (monitor::Event::BootUp, _) => {
                self.forget(now);
                self.attempt(now, true);
            }
            (monitor::Event::Lost(_), Phase::Booted) => {
                self.phase = Phase::Lost;
                self.attempt(now + retry, false);
            }
            // It has lost nothing; whether it is in another state shows.
            (monitor::Event::Resumed(_), Phase::Lost) => {
                self.phase = Phase::Booted;
                self.attempt = None;
            }
            (monitor::Event::Started(_) | monitor::Event::Resumed(_), Phase::Absent) => {
                self.attempt(now, true);
            }
            _ => {}
        }
    }

    /// When something is due; `sends`: whether there is a bus.
    pub fn poll_at(&self, sends: bool) -> Option<Instant> {
        let attempt = self.attempt.filter(|_| sends && !self.waits).map(|(at, _)| at);
        match (attempt, self.monitor.poll_at()) {
            (Some(attempt), Some(monitor)) => Some(attempt.min(monitor)),
            (attempt, monitor) => attempt.or(monitor),
        }
    }
}
