//! Current on and off: the state machine, stops, faults.

use std::time::Duration;

use puente_drives::cia402::object as drive;
use puente_drives::cia402::{Controlword, Mode, State};
use puente_line::Instant;

use super::alarm::{self, Alarm};
use super::course::{Course, Point};
use super::homing::Homing;
use super::machine::{Ask, Turn, ask, turn};
use super::{After, Cycles, Drive, objects};
use crate::can::node::{Errors, Model, Objects};

/// From the command to the current, *assumed*: the brake opens.
const ENABLING: Duration = Duration::from_millis(20);

/// How it stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ramp {
    /// It does not: its current is gone.
    None,
    /// With the profile's deceleration.
    Profile,
    /// With the quick stop's.
    Quick,
}

impl Ramp {
    /// What an option code means; of 3 and 4, 7 and 8 (at the limits of current and voltage) the quick ramp.
    fn of(option: i64) -> Self {
        match option {
            0 => Self::None,
            1 | 5 => Self::Profile,
            _ => Self::Quick,
        }
    }
}

impl Drive {
    /// Switched on: nothing is known of before.
    pub(in crate::can) fn power_on(&mut self, now: Instant, objects: &mut Objects) {
        (self.homed, self.zero) = (false, 0.0);
        self.start(now, objects);
    }

    /// NMT reset node: as after power-on, but that it knows where it is. The values have been restored.
    pub(in crate::can) fn restart(&mut self, now: Instant, objects: &mut Objects, errors: &mut Errors) {
        let enabled = self.state == State::OperationEnabled;
        self.start(now, objects);
        if enabled {
            self.alarm_of_reset(objects, errors);
        }
        self.publish(objects);
    }

    /// Without current, in no mode, with no set-point.
    pub(super) fn start(&mut self, now: Instant, objects: &mut Objects) {
        self.now = now;
        self.state = State::SwitchOnDisabled;
        (self.mode, self.control, self.alarm) = (Mode::None, 0, None);
        self.cycles = Cycles::default();
        self.drop_current();
        self.take_period(objects, true);
        self.publish(objects);
    }

    /// The motor coasts, and nothing waits.
    fn drop_current(&mut self) {
        (self.enabling, self.after, self.astray) = (None, None, None);
        self.homing = Homing::default();
        self.forget_set_points();
    }

    pub(super) fn take_control(&mut self, objects: &mut Objects, errors: &mut Errors) {
        let control = objects.value(drive::CONTROLWORD) as u16;
        let before = std::mem::replace(&mut self.control, control);
        let rising = control & !before;
        if rising & Controlword::FAULT_RESET != 0 {
            return self.reset_fault(objects, errors);
        }
        match turn(self.state, ask(control)) {
            Turn::Stay if self.enabling.is_some() && ask(control) != Ask::EnableOperation => {
                self.enabling = None;
            }
            Turn::Stay => {}
            Turn::Enable => {
                self.enabling.get_or_insert(self.now + ENABLING);
                self.reached = true;
            }
            Turn::Go(State::OperationEnabled) => self.leave_quick_stop(objects),
            Turn::Go(state) => {
                self.drop_current();
                self.state = state;
            }
            Turn::Drop => {
                self.drop_current();
                self.state = State::SwitchOnDisabled;
            }
            Turn::Stop(state) => {
                let option =
                    if state == State::SwitchedOn { drive::DISABLE_OPTION } else { drive::SHUTDOWN_OPTION };
                self.stop(Ramp::of(objects.value(option)), After::State(state), objects);
            }
            Turn::QuickStop => self.quick_stop(objects),
        }
        if self.state == State::OperationEnabled && self.after.is_none() {
            self.take_mode_bits(rising, before & !control, objects);
        }
    }

    fn quick_stop(&mut self, objects: &Objects) {
        let option = objects.value(drive::QUICK_STOP_OPTION);
        let after = if option >= 5 { After::Hold } else { After::State(State::SwitchOnDisabled) };
        self.state = State::QuickStopActive;
        self.stop(Ramp::of(option), after, objects);
    }

    /// Transition 16: only where a quick stop holds the axis.
    fn leave_quick_stop(&mut self, objects: &Objects) {
        if objects.value(drive::QUICK_STOP_OPTION) >= 5 {
            self.state = State::OperationEnabled;
            self.after = None;
        }
    }

    /// It stops, and does not look at its mode until then.
    fn stop(&mut self, ramp: Ramp, after: After, objects: &Objects) {
        let rate = match ramp {
            Ramp::None => {
                self.drop_current();
                return self.follow_up(after);
            }
            Ramp::Profile => drive::PROFILE_DECELERATION,
            Ramp::Quick => drive::QUICK_STOP_DECELERATION,
        };
        self.homing = Homing::default();
        self.forget_set_points();
        let from = self.moving_point();
        self.go(Course::stop(from, (objects.value(rate) as f64).max(1.0)));
        self.after = Some(after);
    }

    /// From where a stop begins: a demand that the motor does not follow, as in a torque mode, counts for nothing.
    pub(super) fn moving_point(&self) -> Point {
        if self.mode_is_torque() { self.axis.actual } else { self.demanded() }
    }

    fn follow_up(&mut self, after: After) {
        match after {
            After::State(state) => {
                self.drop_current();
                self.state = state;
            }
            After::Hold => {}
        }
    }

    pub(super) fn finish_stop(&mut self, _objects: &Objects) {
        if self.stands()
            && let Some(after) = self.after
            && after != After::Hold
        {
            self.follow_up(after);
        }
    }

    pub(super) fn finish_enabling(&mut self) {
        if self.enabling.take_if(|at| *at <= self.now).is_some() {
            self.state = State::OperationEnabled;
            // Whatever it was told before: it stays where it is.
            self.go(Course::standing(self.axis.actual.position));
            self.target = self.axis.actual.position;
            self.limited = false;
        }
    }

    /// Something is wrong.
    pub(super) fn fall(&mut self, alarm: Alarm, objects: &mut Objects, errors: &mut Errors) {
        if alarm.warns {
            return errors.event(objects, alarm.code, alarm.vendor(self.model));
        }
        if matches!(self.state, State::Fault | State::FaultReactionActive) {
            return;
        }
        errors.raise(objects, alarm.code, alarm.register, alarm.vendor(self.model));
        objects.put(drive::ERROR_CODE, alarm.code.into());
        self.alarm = Some(alarm);
        let ramp = if alarm.ramps && self.state.is_powered() {
            Ramp::of(objects.value(drive::FAULT_OPTION))
        } else {
            Ramp::None
        };
        self.state = State::FaultReactionActive;
        self.stop(ramp, After::State(State::Fault), objects);
    }

    fn reset_fault(&mut self, objects: &mut Objects, errors: &mut Errors) {
        let Some(alarm) = self.alarm.filter(|_| self.state == State::Fault) else { return };
        if self.hot && alarm == alarm::HOT {
            return;
        }
        errors.clear(objects, alarm.code);
        self.alarm = None;
        self.state = State::SwitchOnDisabled;
    }

    /// 6007h says what the drive does when its master is lost.
    pub(in crate::can) fn lose_master(&mut self, now: Instant, objects: &mut Objects, errors: &mut Errors) {
        self.advance(now, objects, errors);
        match objects.value(objects::CONNECTION_OPTION) {
            1 => self.fall(alarm::CONNECTION, objects, errors),
            2 if self.state.is_powered() => {
                self.drop_current();
                self.state = State::SwitchOnDisabled;
            }
            3 if self.state == State::OperationEnabled => self.quick_stop(objects),
            _ => {}
        }
        self.publish(objects);
    }

    /// NMT reset communication.
    pub(in crate::can) fn reset_by_master(
        &mut self,
        now: Instant,
        objects: &mut Objects,
        errors: &mut Errors,
    ) {
        self.advance(now, objects, errors);
        if self.state == State::OperationEnabled {
            self.drop_current();
            self.state = State::SwitchOnDisabled;
            self.alarm_of_reset(objects, errors);
        }
        self.publish(objects);
    }

    /// After an NMT reset a Lexium that was under current has AL401 (thesis, 6.4); the others have lost their current, no
    /// more (*assumed*).
    fn alarm_of_reset(&mut self, objects: &mut Objects, errors: &mut Errors) {
        if self.model == Model::Lexium23a {
            self.fall(alarm::RESET, objects, errors);
        }
    }
}
