//! What is read and written over SDO, one object at a time.

use puente_canopen::sdo::{self, Abort};
use puente_drives::cia402::object::{ERROR_CODE, MAX_PROFILE_VELOCITY, STATUSWORD};
use puente_drives::cia402::{Mode, Object, Preset, State, presets};
use puente_line::Instant;

use super::{ANSWER, Drive, SILENCE};
use crate::{Failure, Node, Order, Progress};

/// An object to be read, or written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Job {
    pub object: Object,
    /// What is written.
    pub write: Option<i64>,
    purpose: Purpose,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    /// It is examined.
    Check,
    /// It is taken note of as if a PDO had it.
    Known,
    /// It counts as told.
    Noted,
    /// Where it stands, for a preset.
    Stands,
    /// The preset of this mode.
    Preset(Mode),
    /// What the drive shall be told, and no PDO has.
    Told,
    /// How fast it may be.
    Limit,
    /// Why it is in fault.
    Fault,
}

impl Job {
    pub(super) const fn known(object: Object) -> Self {
        Self { object, write: None, purpose: Purpose::Known }
    }

    pub(super) const fn noted(object: Object) -> Self {
        Self { object, write: None, purpose: Purpose::Noted }
    }

    pub(super) const fn limit(object: Object) -> Self {
        Self { object, write: None, purpose: Purpose::Limit }
    }

    pub(super) const fn check(object: Object) -> Self {
        Self { object, write: None, purpose: Purpose::Check }
    }
}

impl Drive {
    /// Asks for something to be read or written, unless something else is.
    pub(super) fn ask(&mut self, job: Job) {
        if !self.working {
            self.job = Some(job);
        }
    }

    /// What is to be read or written, where that is not in work.
    pub fn job(&self) -> Option<Job> {
        self.job.filter(|_| !self.working)
    }

    /// It is in work.
    pub fn begin(&mut self) {
        self.working = true;
    }

    /// Whether a transfer is in work, and of what.
    pub fn working(&self) -> Option<Job> {
        self.job.filter(|_| self.working)
    }

    /// What came of it: the bytes that were read.
    pub fn answered(&mut self, now: Instant, end: Result<&[u8], sdo::Failure>) {
        self.working = false;
        self.due = true;
        let Some(job) = self.job.take() else {
            return;
        };
        if job.purpose == Purpose::Check {
            return self.examined(now, end);
        }
        let kind = job.object.kind;
        let value = end.and_then(|bytes| match job.write {
            Some(value) => Ok(value),
            None => kind
                .read(bytes)
                .ok_or(sdo::Failure::Size { expected: kind.size() as u32, received: bytes.len() as u32 }),
        });
        match value {
            Ok(value) => self.answer(now, job, value),
            Err(failure) => self.unanswered(now, job, failure),
        }
    }

    fn answer(&mut self, now: Instant, job: Job, value: i64) {
        match job.purpose {
            Purpose::Check => {}
            Purpose::Known => {
                let before = self.input.state();
                self.input.take(now, job.object, value);
                self.heard(now, before);
            }
            Purpose::Noted | Purpose::Told => self.output.note(job.object, value),
            Purpose::Stands => self.stands_at = Some(value),
            Purpose::Preset(mode) => {
                self.output.note(job.object, value);
                if self.order.wants_current() && self.node == Node::Present {
                    self.set_point = value as i32;
                    self.stands_at = None;
                    self.presets_are(mode);
                }
            }
            Purpose::Limit => self.limit(job.object, value as u32),
            Purpose::Fault => {
                self.fault = Some(value as u16);
                self.fault_read = true;
                self.news = true;
            }
        }
    }

    fn unanswered(&mut self, now: Instant, job: Job, failure: sdo::Failure) {
        match job.purpose {
            Purpose::Check | Purpose::Known => self.patient_until = now + SILENCE,
            Purpose::Fault => self.fault_read = true,
            // It is the only one that a drive may be without.
            Purpose::Limit if job.object == MAX_PROFILE_VELOCITY && is_missing(failure) => {
                self.limit(job.object, u32::MAX);
            }
            Purpose::Limit | Purpose::Noted | Purpose::Stands | Purpose::Preset(_) | Purpose::Told => {
                self.output.leave(job.object);
                self.trouble = Some(Failure::Object { address: job.object.address, failure });
            }
        }
    }

    fn presets_are(&mut self, mode: Mode) {
        self.preset = Some(mode);
        self.armed = true;
        self.streamed = 0;
    }

    /// Whether the set-points of a mode are where the drive stands; otherwise they are set so.
    pub(super) fn is_preset(&mut self, mode: Mode) -> bool {
        if self.preset == Some(mode) {
            return true;
        }
        let job = |object, write, purpose| Job { object, write, purpose };
        match presets(mode) {
            None => {
                self.presets_are(mode);
                return true;
            }
            Some(Preset::Zero { target }) => self.ask(job(target, Some(0), Purpose::Preset(mode))),
            Some(Preset::Actual { target, actual }) => self.ask(match self.stands_at {
                None => job(actual, None, Purpose::Stands),
                Some(here) => job(target, Some(here), Purpose::Preset(mode)),
            }),
        }
        false
    }

    /// What is to be read or written besides.
    pub(super) fn errand(&mut self, now: Instant) -> Option<Job> {
        if self.node != Node::Present {
            return None;
        }
        if let Some((object, value)) = self.output.write(&self.axis).filter(|_| self.order.wants_current()) {
            return Some(Job { object, write: Some(value), purpose: Purpose::Told });
        }
        if self.input.state() == Some(State::Fault) && !self.fault_read {
            return Some(Job { object: ERROR_CODE, write: None, purpose: Purpose::Fault });
        }
        if self.order == Order::Observe {
            return None;
        }
        let waits_since = if !self.output.is_told() {
            return None;
        } else if !self.is_current() {
            self.output.told_at() + ANSWER
        } else if self.progress == Progress::Running {
            self.input.at? + SILENCE
        } else {
            return None;
        };
        let at = waits_since.max(self.patient_until);
        if at <= now {
            return Some(Job::known(STATUSWORD));
        }
        self.wake_at(at);
        None
    }
}

/// Whether there is no such object.
fn is_missing(failure: sdo::Failure) -> bool {
    matches!(failure, sdo::Failure::Aborted(Abort::NO_OBJECT | Abort::NO_SUB_INDEX))
}
