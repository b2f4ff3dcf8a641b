//! The modes of operation, but homing.

use puente_drives::cia402::object as drive;
use puente_drives::cia402::{Controlword, Mode, Period, State, parameter_of_delta};

use super::course::{Course, Limits};
use super::objects::{JOG_SPEED, TORQUE_SLOPE};
use super::{Drive, alarm};
use crate::can::drive::axis::input;
use crate::can::node::{Errors, Objects};

/// Jog of the Lexium, *assumed*: bit 4 goes forward, bit 5 backward.
const JOG_BACKWARD: u16 = Controlword::IMMEDIATELY;

/// Of the rated velocity of a motor, in torque modes, *assumed*: 3000 r/min.
const MOST: f64 = 5_000_000.0;

/// A target of profile position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SetPoint {
    /// From the machine's zero.
    target: f64,
    limits: Limits,
    /// It was beyond a software limit.
    limited: bool,
}

impl Drive {
    pub(super) fn mode_is_torque(&self) -> bool {
        matches!(self.mode, Mode::ProfileTorque | Mode::CyclicTorque)
    }

    pub(super) fn follows_cyclically(&self) -> bool {
        let cyclic = matches!(self.mode, Mode::CyclicPosition | Mode::CyclicVelocity | Mode::CyclicTorque);
        self.state == State::OperationEnabled && cyclic
    }

    pub(super) fn forget_set_points(&mut self) {
        (self.set_point, self.next, self.acknowledged, self.active) = (None, None, false, false);
        (self.torque, self.target_torque) = (0.0, 0.0);
        self.leave_window();
    }

    pub(super) fn halted(&self) -> bool {
        self.control & Controlword::HALT != 0
    }

    /// Another mode: what goes on is stopped.
    pub(super) fn change_mode(&mut self, objects: &Objects) {
        let Some(mode) = Mode::from_code(objects.value(drive::MODE) as i8).filter(|mode| *mode != self.mode)
        else {
            return;
        };
        let from = self.moving_point();
        self.mode = mode;
        self.homing.stop();
        self.forget_set_points();
        if self.state == State::OperationEnabled && self.after.is_none() {
            self.go(Course::stop(from, self.limits(objects).deceleration));
            self.target = self.course.end().position;
            self.take_target(objects);
        }
    }

    /// The mode's bits of the controlword: those that have risen, and fallen.
    pub(super) fn take_mode_bits(&mut self, rising: u16, falling: u16, objects: &Objects) {
        let new = Controlword::MODE_4;
        match self.mode {
            Mode::ProfilePosition if rising & new != 0 => self.take_set_point(objects),
            Mode::InterpolatedPosition if (rising | falling) & new != 0 => {
                self.active = rising & new != 0;
                self.go(Course::stop(self.demanded(), self.limits(objects).deceleration));
            }
            Mode::Homing if rising & new != 0 => self.start_homing(objects),
            Mode::Homing if falling & new != 0 => self.interrupt_homing(objects),
            Mode::JOG if (rising | falling) & (new | JOG_BACKWARD) != 0 => self.jog(objects),
            Mode::ProfileVelocity => self.take_target(objects),
            _ => {}
        }
        self.release_acknowledgement();
        if rising & Controlword::HALT != 0 {
            self.halt(objects);
        } else if falling & Controlword::HALT != 0 {
            self.resume(objects);
        }
    }

    /// 605Dh: 1 the profile's ramp, 2 to 4 the quick stop's.
    fn halt(&mut self, objects: &Objects) {
        let quick = objects.value(drive::HALT_OPTION) > 1;
        let rate = if quick { drive::QUICK_STOP_DECELERATION } else { drive::PROFILE_DECELERATION };
        self.go(Course::stop(self.moving_point(), (objects.value(rate) as f64).max(1.0)));
        self.leave_window();
    }

    fn resume(&mut self, objects: &Objects) {
        self.leave_window();
        match self.mode {
            Mode::ProfilePosition => {
                if let Some(set_point) = self.set_point {
                    self.begin(set_point);
                }
            }
            Mode::Homing => self.homing.resume(),
            _ => self.take_target(objects),
        }
    }

    /// A new set-point of profile position: bit 4 of the controlword has risen.
    fn take_set_point(&mut self, objects: &Objects) {
        let target = objects.value(drive::TARGET_POSITION);
        let relative = self.control & Controlword::RELATIVE != 0;
        let last = self.next.or(self.set_point).map_or(self.target, |set_point| set_point.target);
        let target = if relative { last + target as f64 } else { self.in_machine(target) };
        let (target, limited) = self.within_limits(target, objects);
        let set_point = SetPoint { target, limits: self.limits(objects), limited };
        let under_way = self.set_point.is_some() && !self.stands();
        if !under_way || self.control & Controlword::IMMEDIATELY != 0 {
            self.next = None;
            self.begin(set_point);
        } else if self.next.is_none() {
            self.next = Some(set_point);
            if self.control & Controlword::ON_SET_POINT != 0 {
                self.pass();
            }
        } else {
            return;
        }
        self.acknowledged = true;
        self.leave_window();
    }

    fn begin(&mut self, set_point: SetPoint) {
        self.limited = set_point.limited;
        self.set_point = Some(set_point);
        self.target = set_point.target;
        if !self.halted() {
            self.go(Course::to_position(self.demanded(), set_point.target, set_point.limits, 0.0));
        }
    }

    /// The set-point under way is passed with its velocity, where the next one lies in the same direction.
    fn pass(&mut self) {
        let (Some(now), Some(next)) = (self.set_point, self.next) else { return };
        let from = self.demanded();
        if (now.target - from.position) * (next.target - now.target) > 0.0 {
            self.go(Course::to_position(from, now.target, now.limits, now.limits.velocity));
        }
    }

    /// What a mode does by itself as time passes.
    pub(super) fn go_on(&mut self, objects: &Objects) {
        if self.mode == Mode::ProfilePosition
            && !self.halted()
            && self.is_there()
            && let Some(next) = self.next.take()
        {
            self.begin(next);
        }
        if self.mode == Mode::ProfileVelocity && self.limited {
            self.take_target(objects);
        }
        self.release_acknowledgement();
    }

    /// It is taken back when bit 4 is 0 and another set-point can be taken.
    fn release_acknowledgement(&mut self) {
        if self.acknowledgement_pends() && self.next.is_none() {
            self.acknowledged = false;
        }
    }

    pub(super) fn acknowledgement_pends(&self) -> bool {
        self.acknowledged && self.control & Controlword::MODE_4 == 0
    }

    /// A target has been written, or counts from now on.
    pub(super) fn take_target(&mut self, objects: &Objects) {
        let runs = self.state == State::OperationEnabled && self.after.is_none() && !self.halted();
        self.fresh |= self.follows_cyclically();
        if !runs {
            return;
        }
        match self.mode {
            Mode::ProfileTorque | Mode::CyclicTorque => {
                self.target_torque = objects.value(drive::TARGET_TORQUE) as f64 / 1_000.0;
                self.leave_window();
            }
            Mode::ProfileVelocity => self.turn_to(objects.value(drive::TARGET_VELOCITY) as f64, objects),
            Mode::CyclicPosition => {
                let target = self.in_machine(objects.value(drive::TARGET_POSITION));
                self.follow_straight(target, objects);
            }
            Mode::CyclicVelocity => {
                let velocity = objects.value(drive::TARGET_VELOCITY) as f64;
                let from = self.demanded();
                let rate = ((velocity - from.velocity) / self.period).abs().max(1.0);
                self.go(Course::to_velocity(from, velocity, rate, rate));
            }
            _ => {}
        }
    }

    /// To a velocity, unless a limit is in the way.
    fn turn_to(&mut self, velocity: f64, objects: &Objects) {
        let limits = self.limits(objects);
        let most = (objects.value(drive::MAX_PROFILE_VELOCITY) as f64).max(1.0);
        let velocity = if self.is_barred(velocity, objects) { 0.0 } else { velocity.clamp(-most, most) };
        self.limited &= velocity == 0.0;
        if self.course.end().velocity != velocity || !self.is_there() {
            self.leave_window();
        }
        self.go(Course::to_velocity(self.demanded(), velocity, limits.acceleration, limits.deceleration));
    }

    fn jog(&mut self, objects: &Objects) {
        let (group, number) = JOG_SPEED;
        let rpm = parameter_of_delta(group, number).map_or(0, |address| objects.get(address)) as f64;
        let bit = |mask| f64::from(self.control & mask != 0);
        let direction = bit(Controlword::MODE_4) - bit(JOG_BACKWARD);
        self.turn_to(direction * rpm / 60.0 * self.axis.turn(), objects);
    }

    /// Of the rated torque, along its slope (6087h); cyclic torque counts at once.
    pub(super) fn push(&mut self, seconds: f64, objects: &Objects) {
        let target = if self.halted() { 0.0 } else { self.target_torque };
        let slope = match self.mode {
            Mode::ProfileTorque => (objects.value(TORQUE_SLOPE) as f64 / 1_000.0).max(0.001) * seconds,
            _ => f64::INFINITY,
        };
        self.torque += (target - self.torque).clamp(-slope, slope);
        self.axis.push(self.torque, MOST, seconds);
        self.go(Course::standing(self.axis.actual.position));
    }

    /// A set-point of interpolated position: it is reached when the period is over.
    pub(super) fn interpolate(&mut self, objects: &Objects) {
        self.fresh = true;
        if !self.interpolates() || self.halted() || self.after.is_some() {
            return;
        }
        let set_point = objects.value(drive::INTERPOLATION_SET_POINT);
        let relative =
            self.profile.interpolation.says_relative && objects.value(drive::INTERPOLATION_RELATIVE) != 0;
        let target = if relative { self.target + set_point as f64 } else { self.in_machine(set_point) };
        self.follow_straight(target, objects);
    }

    fn follow_straight(&mut self, target: f64, objects: &Objects) {
        (self.target, self.limited) = self.within_limits(target, objects);
        let target = self.target;
        self.go(Course::straight(self.demanded().position, target, self.period));
    }

    /// 60C2h; of a Festo drive a new one counts only from power-on on, if it has been stored.
    pub(super) fn take_period(&mut self, objects: &Objects, power_on: bool) {
        if self.profile.interpolation.period_needs_reset && !power_on {
            return;
        }
        let (value, exponent) = (objects.value(drive::PERIOD_VALUE), objects.value(drive::PERIOD_EXPONENT));
        if let Some(period) = Period::from_parts(value as u8, exponent as i8) {
            self.period = period.time().as_secs_f64();
        }
    }

    /// The software limits from the machine's zero, where there are any (607Dh); they count once home is known.
    fn software_limits(&self, objects: &Objects) -> Option<[f64; 2]> {
        let (low, high) = (objects.value(drive::LIMIT_LOW), objects.value(drive::LIMIT_HIGH));
        (low < high && self.homed).then(|| [self.in_machine(low), self.in_machine(high)])
    }

    /// A target within the software limits, and whether it was beyond them.
    fn within_limits(&self, target: f64, objects: &Objects) -> (f64, bool) {
        match self.software_limits(objects) {
            Some([low, high]) => (target.clamp(low, high), !(low..=high).contains(&target)),
            None => (target, false),
        }
    }

    /// Whether it may not go on with a velocity: a limit switch is on, or it is at a software limit.
    fn is_barred(&self, velocity: f64, objects: &Objects) -> bool {
        let inputs = self.axis.inputs();
        let at = self.demanded().position;
        let soft = self.software_limits(objects);
        if velocity > 0.0 {
            inputs & input::POSITIVE != 0 || soft.is_some_and(|[_, high]| at >= high)
        } else if velocity < 0.0 {
            inputs & input::NEGATIVE != 0 || soft.is_some_and(|[low, _]| at <= low)
        } else {
            false
        }
    }

    /// Who runs into a limit stops with the quick ramp, and gives its set-points up.
    pub(super) fn respect_limits(&mut self, objects: &mut Objects, errors: &mut Errors) {
        let velocity = self.demanded().velocity;
        if self.mode_is_torque() || !self.is_barred(velocity, objects) {
            return;
        }
        let was = std::mem::replace(&mut self.limited, true);
        let stopping = self.course.end().velocity == 0.0 && self.set_point.is_none() && was;
        if stopping {
            return;
        }
        (self.set_point, self.next) = (None, None);
        let rate = (objects.value(drive::QUICK_STOP_DECELERATION) as f64).max(1.0);
        self.go(Course::stop(self.demanded(), rate));
        let alarm = if velocity > 0.0 { alarm::POSITIVE_LIMIT } else { alarm::NEGATIVE_LIMIT };
        self.fall(alarm, objects, errors);
    }
}
