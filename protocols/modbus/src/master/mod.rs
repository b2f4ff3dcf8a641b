//! The master of a serial line.

mod outgoing;
mod receiver;
mod types;
mod units;

use core::time::Duration;

use puente_line::Instant;

pub use types::{Action, Busy, Config, Counters, Echo, Evidence, Outcome};

use crate::{BROADCAST, Frame, FrameError, Mode, Pdu, ascii, function, rtu};
use outgoing::Outgoing;
use receiver::Receiver;
use units::Units;

/// The master of a half-duplex serial line, one request outstanding.
///
/// What keeps a reply from being paired with another request:
///
/// - A reply must have the unit, the function (or its exception), the length and byte count that the request calls for, and
///   repeat the fields that a reply repeats. Valid frames that do not are counted and passed over: the true reply may follow.
/// - After a timeout the line must fall silent before the next request, and the unit that kept us waiting is left alone for
///   [`Config::quarantine`], or until its late reply is seen. Others are addressed at once.
///
/// What nothing on the wire can tell is a second, unasked reply that arrives while the next request of the same unit, function
/// and quantity is waiting.
///
/// A reply is delivered with its last byte: an RTU frame ends where its function code says, and a pause inside it, which an
/// operating system or USB adapter may have put there, does not void it. Silence ends frames of opaque functions only. ASCII
/// frames end with LF.
#[derive(Clone, Debug)]
pub struct Master {
    config: Config,
    /// Silence before a transmission.
    gap: Duration,
    state: State,
    request: Outgoing,
    /// Characters of the request's echo still to come.
    echo_left: usize,
    receiver: Receiver,
    last_received: Instant,
    /// Since when, or from when on, the line is silent.
    quiet_from: Instant,
    /// Since when it has not been, without a silence between frames.
    busy_from: Instant,
    units: Units,
    counters: Counters,
    reply: Pdu,
}

#[derive(Clone, Copy, Debug)]
enum State {
    /// No request.
    Idle,
    /// The line must fall silent, the unit must be ready.
    Queued,
    /// Sent; the reply is due by `deadline`. One that is arriving then may go on until `limit`.
    Waiting { deadline: Instant, limit: Instant, evidence: Option<Evidence> },
    /// Broadcast; the slaves get time to work.
    Turnaround { until: Instant },
    /// The outcome has not been fetched.
    Finished(End),
}

#[derive(Clone, Copy, Debug)]
enum End {
    Reply,
    Broadcast,
    NoReply(Evidence),
}

impl Master {
    /// A master for a line.
    pub fn new(config: Config) -> Self {
        let gap = match config.mode {
            Mode::Rtu => rtu::t3_5(config.line),
            // The specification asks for none; this keeps us from talking into a frame.
            Mode::Ascii => rtu::t1_5(config.line),
        };
        Self {
            config,
            gap: gap.max(config.silence),
            state: State::Idle,
            request: Outgoing::none(),
            echo_left: 0,
            receiver: Receiver::new(config.mode),
            last_received: Instant::ZERO,
            quiet_from: Instant::ZERO,
            busy_from: Instant::ZERO,
            units: Units::new(),
            counters: Counters::default(),
            reply: Pdu::new(),
        }
    }

    /// Takes a request PDU for `unit`, 0 for all. One that is malformed is done at once, unsent
    /// ([`Evidence::Malformed`]).
    ///
    /// # Errors
    /// `Busy` until the outcome of the last one has been fetched.
    pub fn submit(&mut self, unit: u8, pdu: &[u8]) -> Result<(), Busy> {
        let State::Idle = self.state else {
            return Err(Busy);
        };
        self.state = match Outgoing::new(self.config.mode, unit, pdu) {
            Ok(request) => {
                self.request = request;
                State::Queued
            }
            Err(exception) => State::Finished(End::NoReply(Evidence::Malformed(exception))),
        };
        Ok(())
    }

    /// Takes back a request that has not been sent; false if there is none.
    pub fn withdraw(&mut self) -> bool {
        let queued = matches!(self.state, State::Queued);
        if queued {
            self.state = State::Idle;
        }
        queued
    }

    /// From when on `unit` may be addressed: its rest and its quarantine are over then.
    pub fn ready_at(&self, unit: u8) -> Instant {
        self.units.ready_at(unit)
    }

    /// Whether `unit` has not answered its last request, so that its late reply may still come.
    pub fn owes(&self, unit: u8) -> bool {
        self.units.owes(unit)
    }

    /// Ends the quarantine of `unit`, where it is in one, for a request that no late reply can be taken for the reply to.
    pub fn end_quarantine(&mut self, unit: u8) {
        if self.units.owes(unit) {
            self.units.quarantine(unit, Instant::ZERO);
        }
    }

    /// Takes what the line said.
    pub fn receive(&mut self, now: Instant, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.elapse(now);
        self.hear(now);
        for &byte in bytes {
            if self.echo_left > 0 && self.take_echo(byte) {
                continue;
            }
            if let Some(heard) = self.receiver.push(now, byte, &self.request) {
                self.take_frames(now, Some(heard));
            }
        }
    }

    /// The line reported a parity, framing or overrun error.
    pub fn line_error(&mut self, now: Instant) {
        self.elapse(now);
        self.hear(now);
        count(&mut self.counters.line_errors);
        self.note(Evidence::Line);
    }

    /// What to do now.
    pub fn poll(&mut self, now: Instant) -> Action<'_> {
        self.elapse(now);
        match self.state {
            State::Queued if now >= self.transmit_at() => {
                self.transmit(now);
                Action::Transmit(&self.request.adu)
            }
            State::Finished(end) => {
                self.state = State::Idle;
                Action::Done(match end {
                    End::Reply => Outcome::Reply(&self.reply),
                    End::Broadcast => Outcome::Broadcast,
                    End::NoReply(evidence) => Outcome::NoReply(evidence),
                })
            }
            _ => Action::Idle,
        }
    }

    /// When to poll again, besides after `submit` and `receive`.
    pub fn poll_at(&self) -> Option<Instant> {
        let due = match self.state {
            State::Idle => None,
            State::Queued => Some(self.transmit_at()),
            State::Waiting { deadline, limit, .. } => Some(self.end(deadline, limit)),
            State::Turnaround { until } => Some(until),
            State::Finished(_) => Some(Instant::ZERO),
        };
        match (due, self.silent_at()) {
            (Some(due), Some(silent)) => Some(due.min(silent)),
            (due, silent) => due.or(silent),
        }
    }

    /// What has happened since start-up.
    pub fn counters(&self) -> Counters {
        Counters { garbage_bytes: self.receiver.garbage(), ..self.counters }
    }

    /// The line is in use.
    fn hear(&mut self, now: Instant) {
        if now >= self.quiet_from + self.gap {
            self.busy_from = now;
        }
        self.last_received = now;
        self.quiet_from = self.quiet_from.max(now);
    }

    /// After a silence; but what goes on for longer than the longest frame is noise, such as a line without bias has while
    /// nobody sends, and would hold everything up for ever.
    fn transmit_at(&self) -> Instant {
        let noise = self.busy_from + self.longest();
        (self.quiet_from.min(noise) + self.gap).max(self.units.ready_at(self.request.unit))
    }

    /// Wire time of the longest frame.
    fn longest(&self) -> Duration {
        self.config.line.wire_time(match self.config.mode {
            Mode::Rtu => rtu::MAX_ADU,
            Mode::Ascii => ascii::MAX_ADU,
        })
    }

    /// When the burst that is arriving ends, if nothing more comes.
    fn silent_at(&self) -> Option<Instant> {
        self.receiver.is_unsettled().then(|| self.last_received + self.gap)
    }

    /// When waiting ends: at the deadline, but not while a frame is arriving, nor ever after the limit.
    fn end(&self, deadline: Instant, limit: Instant) -> Instant {
        deadline.max(limit.min(self.last_received + self.gap))
    }

    fn transmit(&mut self, now: Instant) {
        count(&mut self.counters.requests);
        self.receiver.clear();
        self.echo_left = match self.config.echo {
            Echo::Off => 0,
            Echo::Strip | Echo::Verify => self.request.adu.len(),
        };
        let sent = now + self.config.line.wire_time(self.request.adu.len());
        self.quiet_from = sent;
        self.busy_from = sent;
        self.state = if self.request.unit == BROADCAST {
            State::Turnaround { until: sent + self.config.turnaround }
        } else {
            let deadline = sent + self.config.reply_timeout;
            State::Waiting { deadline, limit: deadline + self.longest(), evidence: None }
        };
    }

    /// Does what time alone brings about.
    fn elapse(&mut self, now: Instant) {
        if let State::Waiting { deadline, limit, .. } = self.state
            && now >= self.end(deadline, limit)
        {
            self.silence(now);
            self.expire();
        } else if self.silent_at().is_some_and(|at| now >= at) {
            self.silence(now);
        }
        if let State::Turnaround { until } = self.state
            && now >= until
        {
            let end = if self.echo_left > 0 { End::NoReply(Evidence::EchoMissing) } else { End::Broadcast };
            self.echo_left = 0;
            self.state = State::Finished(end);
        }
    }

    fn silence(&mut self, now: Instant) {
        self.receiver.silence();
        let heard = self.receiver.next(&self.request);
        self.take_frames(now, heard);
        if let Some(error) = self.receiver.damage() {
            self.take_damage(error);
        }
    }

    /// The deadline has come; a reply may have ended with the silence just before.
    fn expire(&mut self) {
        if let State::Waiting { evidence, .. } = self.state {
            self.fail(match evidence {
                _ if self.echo_left > 0 => Evidence::EchoMissing,
                Some(evidence) => evidence,
                None => Evidence::Silence,
            });
        }
    }

    /// Ends the transaction without a reply. The unit owes it until the quarantine after the deadline is over.
    fn fail(&mut self, evidence: Evidence) {
        match self.state {
            State::Waiting { deadline, .. } => {
                count(&mut self.counters.timeouts);
                let quiet = self.config.quarantine.max(self.config.rest);
                self.units.quarantine(self.request.unit, deadline + quiet);
            }
            State::Turnaround { until } => {
                self.quiet_from = self.quiet_from.max(until);
                self.busy_from = self.quiet_from;
            }
            State::Idle | State::Queued | State::Finished(_) => return,
        }
        self.echo_left = 0;
        self.state = State::Finished(End::NoReply(evidence));
    }

    /// Takes a byte of the request's echo; false if it is none.
    fn take_echo(&mut self, received: u8) -> bool {
        let at = self.request.adu.len().saturating_sub(self.echo_left);
        match self.request.adu.get(at) {
            Some(&expected) if self.config.echo == Echo::Verify && expected != received => {
                self.fail(Evidence::EchoDiffers { expected, received });
                false
            }
            _ => {
                self.echo_left -= 1;
                true
            }
        }
    }

    fn take_frames(&mut self, now: Instant, mut heard: Option<Result<Frame, FrameError>>) {
        while let Some(result) = heard {
            match result {
                Ok(frame) => self.take_frame(now, frame),
                Err(error) => self.take_damage(error),
            }
            heard = self.receiver.next(&self.request);
        }
    }

    fn take_damage(&mut self, error: FrameError) {
        count(&mut self.counters.check_errors);
        self.note(match error {
            FrameError::Check { expected, received } => Evidence::Check { expected, received },
            error => Evidence::Damaged(error),
        });
    }

    fn take_frame(&mut self, now: Instant, frame: Frame) {
        let waiting = matches!(self.state, State::Waiting { .. });
        match self.request.pair(&frame) {
            Ok(()) if waiting => return self.deliver(now, frame),
            Err(Evidence::Echo) => {
                count(&mut self.counters.echoes);
                return self.note(Evidence::Echo);
            }
            Err(evidence) if waiting => {
                count(match evidence {
                    Evidence::WrongUnit { .. } => &mut self.counters.wrong_unit,
                    Evidence::WrongFunction { .. } => &mut self.counters.wrong_function,
                    _ => &mut self.counters.wrong_length,
                });
                self.note(evidence);
            }
            _ => {}
        }
        // Nobody waits for it, or for another unit's: it may be a reply that was given up.
        let owed = self.units.owes(frame.unit);
        if owed {
            self.units.rest(frame.unit, self.rested(now));
        }
        if owed || !waiting {
            count(&mut self.counters.late);
        }
    }

    fn deliver(&mut self, now: Instant, frame: Frame) {
        let exception = frame.pdu.first().is_some_and(|first| first & function::EXCEPTION != 0);
        count(if exception { &mut self.counters.exceptions } else { &mut self.counters.replies });
        self.units.rest(frame.unit, self.rested(now));
        // The reply proves that the request is out, even where the wire time has not passed.
        self.quiet_from = now;
        self.busy_from = now;
        self.reply = frame.pdu;
        self.state = State::Finished(End::Reply);
    }

    fn rested(&self, now: Instant) -> Option<Instant> {
        (!self.config.rest.is_zero()).then(|| now + self.config.rest)
    }

    /// Keeps why the last bytes were no reply. A line error explains damage, so that damage does not replace it.
    fn note(&mut self, new: Evidence) {
        if let State::Waiting { evidence, .. } = &mut self.state {
            match (*evidence, new) {
                (Some(Evidence::Line), Evidence::Check { .. } | Evidence::Damaged(_)) => {}
                _ => *evidence = Some(new),
            }
        }
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
