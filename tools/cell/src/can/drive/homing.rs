//! Homing (CiA 402): where the switches and the index are, is found by moving.

use puente_drives::cia402::object as drive;

use super::axis::input;
use super::course::Course;
use super::{Drive, Point};
use crate::can::node::Objects;

/// What the axis waits for while it goes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Until {
    /// A switch is on.
    On(u32),
    /// It is off.
    Off(u32),
    /// The index is passed.
    Index,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Leg {
    /// 1 or -1.
    direction: f64,
    fast: bool,
    until: Until,
    /// At a limit switch it goes the other way.
    turns: bool,
}

/// How far it is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Phase {
    /// Nothing has been started, or it was interrupted.
    #[default]
    Idle,
    /// It searches.
    Search,
    /// Home has been found; it stops.
    Found,
    /// Home has been found, and it stands.
    Complete,
    /// It has failed, and stops or stands.
    Failed,
}

/// A homing procedure.
#[derive(Clone, Debug, Default)]
pub(super) struct Homing {
    pub phase: Phase,
    legs: Vec<Leg>,
    /// The first leg is under way.
    moves: bool,
}

impl Homing {
    pub fn is_running(&self) -> bool {
        matches!(self.phase, Phase::Search | Phase::Found)
    }

    pub fn stop(&mut self) {
        *self = Self::default();
    }

    /// After a halt.
    pub fn resume(&mut self) {
        self.moves = false;
    }
}

/// The legs of a method, from a place where these inputs are on; `None` where there is no such method.
fn legs(method: i64, inputs: u32) -> Option<Vec<Leg>> {
    let (switch, search, edge, last, index) = match method {
        // Switch; direction of the search; the edge lies that way from the switch; direction in which it is passed.
        1 | 17 => (input::NEGATIVE, -1.0, 1.0, 1.0, method == 1),
        2 | 18 => (input::POSITIVE, 1.0, -1.0, -1.0, method == 2),
        3..=14 | 19..=30 => {
            let plain = if method > 14 { method - 16 } else { method };
            let (search, edge, last) = match plain {
                3 | 7 => (1.0, -1.0, -1.0),
                4 | 8 => (1.0, -1.0, 1.0),
                5 | 11 => (-1.0, 1.0, 1.0),
                6 | 12 => (-1.0, 1.0, -1.0),
                9 => (1.0, 1.0, -1.0),
                10 => (1.0, 1.0, 1.0),
                13 => (-1.0, -1.0, 1.0),
                _ => (-1.0, -1.0, -1.0),
            };
            (input::HOME, search, edge, last, method <= 14)
        }
        33 | 34 => {
            let direction = if method == 33 { -1.0 } else { 1.0 };
            return Some(vec![Leg { direction, fast: false, until: Until::Index, turns: false }]);
        }
        35 | 37 => return Some(Vec::new()),
        _ => return None,
    };
    let leg = |direction, fast, until| Leg { direction, fast, until, turns: false };
    let mut legs = Vec::new();
    if inputs & switch == 0 {
        let turns = matches!(method, 7..=14 | 23..=30);
        legs.push(Leg { turns, ..leg(search, true, Until::On(switch)) });
    }
    // The edge is passed on the way out of the switch, or into it.
    if edge == last {
        legs.push(leg(last, false, Until::Off(switch)));
    } else {
        legs.push(leg(edge, false, Until::Off(switch)));
        legs.push(leg(last, false, Until::On(switch)));
    }
    if index {
        legs.push(leg(last, false, Until::Index));
    }
    Some(legs)
}

impl Drive {
    /// Bit 4 of the controlword has risen.
    pub(super) fn start_homing(&mut self, objects: &Objects) {
        let method = objects.value(drive::HOMING_METHOD);
        self.limited = false;
        self.homing.stop();
        match legs(method, self.axis.inputs()) {
            None => self.homing.phase = Phase::Failed,
            Some(legs) => {
                self.homing.legs = legs;
                self.homing.phase = Phase::Search;
                self.leave_window();
            }
        }
    }

    /// Bit 4 has fallen.
    pub(super) fn interrupt_homing(&mut self, objects: &Objects) {
        if self.homing.is_running() {
            self.homing.stop();
            self.stop_homing(objects);
        }
    }

    fn stop_homing(&mut self, objects: &Objects) {
        let rate = (objects.value(drive::HOMING_ACCELERATION) as f64).max(1.0);
        self.go(Course::stop(self.demanded(), rate));
    }

    /// The axis has gone on from `before`.
    pub(super) fn home(&mut self, before: f64, objects: &mut Objects) {
        if self.halted() {
            return;
        }
        if self.homing.phase == Phase::Found {
            if self.stands() && (self.axis.actual.position - self.course.end().position).abs() < 1.0 {
                self.homing.phase = Phase::Complete;
            }
            return;
        }
        let Some(leg) = self.homing.legs.first().copied() else {
            return self.found(self.axis.actual.position, objects);
        };
        if !self.homing.moves {
            return self.begin_leg(leg, objects);
        }
        let at = self.axis.actual.position;
        let inputs = self.axis.inputs();
        let place = match leg.until {
            Until::On(switch) => (inputs & switch != 0).then_some(at),
            Until::Off(switch) => (inputs & switch == 0).then_some(at),
            Until::Index => self.axis.index_between(before, at),
        };
        match place {
            Some(place) => {
                self.homing.legs.remove(0);
                self.homing.moves = false;
                if self.homing.legs.is_empty() {
                    self.found(place, objects);
                }
            }
            None => self.look_for_ends(leg, inputs, objects),
        }
    }

    fn begin_leg(&mut self, leg: Leg, objects: &Objects) {
        self.homing.moves = true;
        let speed = if leg.fast { drive::HOMING_FAST } else { drive::HOMING_SLOW };
        let velocity = leg.direction * (objects.value(speed) as f64).max(1.0);
        let rate = (objects.value(drive::HOMING_ACCELERATION) as f64).max(1.0);
        self.go(Course::to_velocity(self.demanded(), velocity, rate, rate));
    }

    /// A limit switch that is not what is searched for.
    fn look_for_ends(&mut self, leg: Leg, inputs: u32, objects: &Objects) {
        let ahead = if leg.direction > 0.0 { input::POSITIVE } else { input::NEGATIVE };
        if inputs & ahead == 0
            || matches!(leg.until, Until::Off(switch) | Until::On(switch) if switch == ahead)
        {
            return;
        }
        if leg.turns
            && let Some(first) = self.homing.legs.first_mut()
        {
            (first.direction, first.turns) = (-leg.direction, false);
            self.homing.moves = false;
        } else {
            self.homing.phase = Phase::Failed;
            self.stop_homing(objects);
        }
    }

    /// Home is where the machine's position was `place`; the zero lies by the home offset (607Ch) from there.
    fn found(&mut self, place: f64, objects: &Objects) {
        self.zero = place + objects.value(drive::HOME_OFFSET) as f64;
        self.homed = true;
        self.homing.phase = Phase::Found;
        self.stop_homing(objects);
        self.target = self.course.end().position;
    }

    /// Whether it stands, as homing sees it.
    pub(super) fn homing_stands(&self) -> bool {
        let Point { velocity, .. } = self.demanded();
        velocity == 0.0
    }
}
