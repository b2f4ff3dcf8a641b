//! Whether a node that has booted is such a drive.

use core::time::Duration;

use puente_canopen::sdo::{self, Abort, Failure};
use puente_drives::cia402::check::{self, Check};
use puente_drives::cia402::object::{PERIOD_EXPONENT, PERIOD_VALUE};
use puente_drives::cia402::{Mode, Object, Period};
use puente_line::Instant;

use super::{Drive, Job};
use crate::Node;

/// What could not be read is asked for again after this.
const AGAIN: Duration = Duration::from_secs(1);

/// A step of the examination.
enum Step {
    Check(Check),
    /// The period of its set-points is as it is, and has to be that of SYNC.
    Period(Object),
}

impl Drive {
    fn step(&self) -> Option<Step> {
        let checks = check::of(self.axis.profile);
        let fixed = self.axis.cyclic() == Some(Mode::InterpolatedPosition)
            && self.axis.profile.interpolation.period_needs_reset
            && !self.sync.is_zero();
        let periods = [PERIOD_VALUE, PERIOD_EXPONENT].into_iter().filter(|_| fixed).map(Step::Period);
        checks.map(Step::Check).chain(periods).nth(self.check)
    }

    /// Goes on with the examination.
    pub(super) fn examine(&mut self, now: Instant) {
        if !self.examined || self.working {
            return;
        }
        if self.patient_until > now {
            return self.wake_at(self.patient_until);
        }
        match self.step() {
            Some(Step::Check(Check { object, .. }) | Step::Period(object)) => self.ask(Job::check(object)),
            None => {
                self.examined = false;
                self.node = Node::Present;
                self.since = now;
                self.due = true;
                self.news = true;
            }
        }
    }

    /// What came of a step.
    pub(super) fn examined(&mut self, now: Instant, end: Result<&[u8], sdo::Failure>) {
        let Some(step) = self.step().filter(|_| self.examined) else {
            return;
        };
        let verdict = match step {
            Step::Check(check) => self.judge(now, check, end),
            Step::Period(object) => self.judge_period(object, end),
        };
        match verdict {
            Ok(()) => self.check += 1,
            Err(node) => {
                self.node = node;
                self.news = true;
                // What it is will not change; whether it answers may.
                self.examined = matches!(node, Node::Unread { .. });
                self.patient_until = now + AGAIN;
                self.wake_at(self.patient_until);
            }
        }
    }

    fn judge(&mut self, now: Instant, check: Check, end: Result<&[u8], Failure>) -> Result<(), Node> {
        let object = check.object;
        let answer = match end {
            Ok(bytes) => Some(bytes),
            Err(Failure::Aborted(Abort::NO_OBJECT | Abort::NO_SUB_INDEX)) => None,
            // It has it.
            Err(Failure::Aborted(Abort::WRITE_ONLY)) => return Ok(()),
            Err(failure) => return Err(Node::Unread { address: object.address, failure }),
        };
        check.judge(self.axis.profile, answer).map_err(Node::Unfit)?;
        if let Some(value) = answer.and_then(|bytes| object.kind.read(bytes)) {
            self.input.take(now, object, value);
        }
        Ok(())
    }

    fn judge_period(&mut self, object: Object, end: Result<&[u8], Failure>) -> Result<(), Node> {
        let address = object.address;
        let bytes = end.map_err(|failure| Node::Unread { address, failure })?;
        let value = object.kind.read(bytes);
        if object == PERIOD_VALUE {
            self.period_value = value.unwrap_or(0) as u8;
            return Ok(());
        }
        let exponent = value.unwrap_or(0) as i8;
        let found = Period::from_parts(self.period_value, exponent).map(Period::time);
        if found == Some(self.sync) {
            return Ok(());
        }
        Err(Node::Period { expected: self.sync, received: found })
    }
}
