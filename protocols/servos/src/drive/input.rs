//! What a drive says: its transmit PDOs.

use puente_canopen::cob::Function;
use puente_canopen::{Frame, pdo};
use puente_drives::cia402::object::{MODE_DISPLAY, POSITION, STATUSWORD, VELOCITY};
use puente_drives::cia402::{Mode, Object, State, Statusword};
use puente_line::Instant;

use crate::Axis;
use crate::setup;

/// What is known of a drive.
#[derive(Clone, Debug, Default)]
pub(super) struct Input {
    pub status: Option<Statusword>,
    /// When the statusword came last.
    pub at: Option<Instant>,
    pub mode: Option<Mode>,
    pub position: Option<i32>,
    pub velocity: Option<i32>,
}

impl Input {
    /// Takes a frame. Whether it was one of this drive's.
    pub fn receive(&mut self, now: Instant, axis: &Axis, frame: &Frame) -> bool {
        let Some(Function::Tpdo(number, node)) = Function::of(frame.id()) else {
            return false;
        };
        if node != axis.node || frame.is_remote() {
            return false;
        }
        let mapping = setup::transmitted(axis, number.into());
        let mut known = false;
        for (mapped, raw) in pdo::values(mapping, frame.data()) {
            known |= [STATUSWORD, MODE_DISPLAY, POSITION, VELOCITY]
                .into_iter()
                .find(|object| object.mapped() == mapped)
                .is_some_and(|object| self.take(now, object, object.kind.extend(raw as u32)));
        }
        known
    }

    /// Takes the value of an object. Whether it is one that is kept.
    pub fn take(&mut self, now: Instant, object: Object, value: i64) -> bool {
        if object == STATUSWORD {
            self.status = Some(Statusword(value as u16));
            self.at = Some(now);
        } else if object == MODE_DISPLAY {
            self.mode = Mode::from_code(value as i8);
        } else if object == POSITION {
            self.position = Some(value as i32);
        } else if object == VELOCITY {
            self.velocity = Some(value as i32);
        } else {
            return false;
        }
        true
    }

    pub fn state(&self) -> Option<State> {
        self.status?.state()
    }

    /// Whether the statusword has come since then.
    pub fn is_since(&self, then: Instant) -> bool {
        self.at.is_some_and(|at| at > then)
    }
}
