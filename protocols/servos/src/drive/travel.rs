//! A move whose set-points come with every SYNC: the way to its target is made here, as fast as the drive is set to.

use puente_drives::cia402::object::{
    MAX_PROFILE_VELOCITY, PROFILE_ACCELERATION, PROFILE_DECELERATION, PROFILE_VELOCITY,
};
use puente_drives::cia402::way::{Limits, Steps, Way};
use puente_drives::cia402::{Mode, Object, Statusword};
use puente_line::Instant;

use super::{CYCLIC_STAND, Drive, Job, MODE_TIME, PRESET_CYCLES, SETTLE};
use crate::{Failure, Progress};

/// What is read before a move, in this order; the last where the move does not say itself how fast.
const LIMITS: [Object; 4] =
    [PROFILE_ACCELERATION, PROFILE_DECELERATION, MAX_PROFILE_VELOCITY, PROFILE_VELOCITY];
/// As many as that.
pub(super) const LIMITS_READ: usize = LIMITS.len();

/// A move under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Travel {
    way: Way,
    steps: Steps,
    phase: Phase,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    /// The drive does not follow yet.
    Awaits,
    /// On with each SYNC.
    Goes,
    /// The way has come to its end,
    Over,
    /// as has been seen.
    Settles,
}

impl Travel {
    /// The set-point of the next SYNC cycle on the way to a target, or to a standstill; whether the way has just come to its
    /// end.
    pub(super) fn step(&mut self, target: Option<i32>) -> (i32, bool) {
        let over = self.phase == Phase::Goes
            && match target {
                Some(target) => self.way.towards(target, &self.steps),
                None => self.way.brake(&self.steps),
            };
        if over {
            self.phase = Phase::Over;
        }
        (self.way.set_point(), over)
    }
}

impl Drive {
    /// Moves to a position.
    pub(super) fn travel(
        &mut self,
        now: Instant,
        status: Statusword,
        mode: Mode,
        target: i32,
        velocity: Option<u32>,
        relative: bool,
    ) -> Result<Progress, Failure> {
        if !self.taken {
            let Some(limits) = self.travel_limits(velocity) else {
                return Ok(Progress::Running);
            };
            if !self.begun && (!self.is_preset(mode) || self.streamed < PRESET_CYCLES) {
                return Ok(Progress::Running);
            }
            let base = if relative { self.target.unwrap_or(self.set_point) } else { 0 };
            let target = base.wrapping_add(target);
            let steps = Steps::new(limits, self.sync);
            self.travel = Some(match self.travel {
                Some(Travel { way, phase, .. }) if phase != Phase::Awaits => {
                    Travel { way, steps, phase: Phase::Goes }
                }
                _ => Travel { way: Way::standing(self.set_point), steps, phase: Phase::Awaits },
            });
            self.target = Some(target);
            self.begun = true;
            self.taken = true;
            self.preset = None;
            self.halted = false;
        }
        self.enabled(mode.run_bits());
        if mode == Mode::CyclicPosition && status.has(Statusword::MODE_13) {
            return Err(Failure::Following);
        }
        let (told, told_at) = (self.output.is_told(), self.output.told_at());
        let Some(travel) = self.travel else {
            return Ok(Progress::Running);
        };
        let phase = match travel.phase {
            Phase::Awaits if told && status.has(Statusword::MODE_12) => Phase::Goes,
            Phase::Awaits if told && self.passed(now, told_at, MODE_TIME) => {
                return Err(Failure::Mode(mode));
            }
            Phase::Over => {
                self.since = now;
                self.wake_at(now + SETTLE);
                Phase::Settles
            }
            Phase::Settles => {
                // Not all say that they are there.
                let since = self.since;
                let settled = self.passed(now, since, SETTLE) && status.has(Statusword::TARGET_REACHED);
                if settled || self.passed(now, since, CYCLIC_STAND) {
                    self.travelled();
                    return Ok(Progress::Reached);
                }
                Phase::Settles
            }
            phase => phase,
        };
        self.travel = Some(Travel { phase, ..travel });
        Ok(Progress::Running)
    }

    /// Slows down on its way, where it is on one; whether it stands.
    pub(super) fn slows_down(&mut self) -> Option<bool> {
        if !self.follows() {
            return None;
        }
        let stands = self.travel?.phase != Phase::Goes;
        self.target = None;
        if stands {
            self.travelled();
        }
        Some(stands)
    }

    /// It is where its set-points have taken it.
    fn travelled(&mut self) {
        self.travel = None;
        self.begun = false;
        self.preset = self.input.mode;
    }

    /// A limit has been read; one that an order before this one has asked for does not count.
    pub(super) fn limit(&mut self, object: Object, value: u32) {
        if LIMITS.get(self.limits.len()) == Some(&object) {
            // As there is room.
            let _ = self.limits.push(value);
        }
    }

    /// How fast a move may be, once that is known.
    fn travel_limits(&mut self, velocity: Option<u32>) -> Option<Limits> {
        if let [acceleration, deceleration, most, ref usual @ ..] = self.limits[..]
            && let Some(velocity) = velocity.or(usual.first().copied())
        {
            return Some(Limits { velocity: velocity.min(most), acceleration, deceleration });
        }
        self.ask(Job::limit(*LIMITS.get(self.limits.len())?));
        None
    }
}
