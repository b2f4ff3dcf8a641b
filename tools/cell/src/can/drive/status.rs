//! What the drive says of itself, and what it watches.

use std::time::Duration;

use puente_drives::cia402::object as drive;
use puente_drives::cia402::{Mode, State, Statusword};

use super::Drive;
use super::alarm;
use super::axis::input;
use super::homing::Phase;
use super::objects::{FOLLOWING_ERROR, TORQUE_DEMAND, VELOCITY_TIME, VELOCITY_WINDOW};
use crate::can::node::{Errors, Model, Objects};

/// Bit 15 of a Lexium: home is known. *Assumed*, as of other drives of the make; the thesis shows it from its homing on.
const REFERENCE_OK: u16 = 1 << 15;
/// 6065h: no following error is too big.
const WINDOW_OFF: i64 = 0xFFFF_FFFF;

impl Drive {
    /// Writes what may have changed into the dictionary.
    pub(super) fn publish(&self, objects: &mut Objects) {
        let demand = self.demanded();
        let actual = self.axis.actual;
        let error = if self.state.is_powered() { demand.position - actual.position } else { 0.0 };
        objects.put(drive::STATUSWORD, self.status().into());
        objects.put(drive::MODE_DISPLAY, self.mode.code().into());
        objects.put(drive::POSITION_DEMAND, round(demand.position - self.zero));
        objects.put(drive::POSITION, round(actual.position - self.zero));
        objects.put(drive::VELOCITY_DEMAND, round(demand.velocity));
        objects.put(drive::VELOCITY, round(actual.velocity));
        objects.put(TORQUE_DEMAND, round(1_000.0 * self.torque));
        objects.put(drive::TORQUE, round(1_000.0 * self.axis.torque));
        objects.put(FOLLOWING_ERROR, round(error));
        objects.put(drive::INPUTS, self.axis.inputs().into());
        if self.alarm.is_none() {
            objects.put(drive::ERROR_CODE, 0);
        }
    }

    fn status(&self) -> u16 {
        let (_, state) = self.state.pattern();
        let bit = |on: bool, bit: u16| if on { bit } else { 0 };
        let limit = self.axis.inputs() & (input::NEGATIVE | input::POSITIVE) != 0;
        let off = matches!(self.state, State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault);
        // A Lexium says so only under current (thesis, 6.4); of the others it is *assumed* that their mains are on.
        let voltage = if self.model == Model::Lexium23a { self.state.is_powered() } else { !off };
        let (reached, mode_12, mode_13) = self.mode_status();
        state
            | Statusword::REMOTE
            | bit(voltage, Statusword::VOLTAGE_ENABLED)
            | bit(limit, Statusword::WARNING)
            | bit(reached, Statusword::TARGET_REACHED)
            | bit(self.limited, Statusword::INTERNAL_LIMIT)
            | bit(mode_12, Statusword::MODE_12)
            | bit(mode_13, Statusword::MODE_13)
            | bit(self.homed && self.model == Model::Lexium23a, REFERENCE_OK)
    }

    /// Bits 10, 12 and 13.
    fn mode_status(&self) -> (bool, bool, bool) {
        let astray = self.alarm == Some(alarm::FOLLOWING_ERROR);
        match self.mode {
            Mode::Homing if self.state == State::OperationEnabled => match self.homing.phase {
                Phase::Idle => (self.reached, false, false),
                Phase::Search => (self.halted() && self.homing_stands(), false, false),
                Phase::Found => (false, true, false),
                Phase::Complete => (true, true, false),
                Phase::Failed => (self.homing_stands(), false, true),
            },
            Mode::ProfilePosition => (self.reached, self.acknowledged, astray),
            Mode::ProfileVelocity => (self.reached, self.axis.actual.velocity == 0.0, false),
            Mode::InterpolatedPosition => (self.reached, self.interpolates(), false),
            Mode::CyclicPosition => (self.reached, self.follows_cyclically(), astray),
            Mode::CyclicVelocity | Mode::CyclicTorque => (self.reached, self.follows_cyclically(), false),
            _ => (self.reached, false, false),
        }
    }

    /// Something else is to be reached from now on.
    pub(super) fn leave_window(&mut self) {
        (self.reached, self.in_window, self.unsettled) = (false, None, true);
    }

    /// Target reached: within its window for its time.
    pub(super) fn watch_window(&mut self, objects: &Objects) {
        if self.enabling.is_some() || self.homing.is_running() {
            return;
        }
        let (within, time) = self.is_within(objects);
        if self.state != State::OperationEnabled || !within {
            (self.reached, self.in_window, self.unsettled) = (false, None, false);
            return;
        }
        self.unsettled = false;
        let since = *self.in_window.get_or_insert(self.now);
        self.reached |= self.now.since(since) >= Duration::from_millis(time as u64);
    }

    fn is_within(&self, objects: &Objects) -> (bool, i64) {
        let actual = self.axis.actual;
        let position_time = objects.value(drive::POSITION_TIME);
        let window = objects.value(VELOCITY_WINDOW) as f64;
        if self.mode_is_torque() {
            return ((self.torque - self.target_torque).abs() < 0.0005, 0);
        }
        if matches!(self.mode, Mode::ProfileVelocity | Mode::CyclicVelocity | Mode::JOG) {
            let target = self.course.end().velocity;
            return ((actual.velocity - target).abs() <= window, objects.value(VELOCITY_TIME));
        }
        let given_up = self.mode == Mode::ProfilePosition && self.limited && self.set_point.is_none();
        let near = (actual.position - self.course.end().position).abs()
            <= objects.value(drive::POSITION_WINDOW) as f64;
        (self.stands() && near && self.next.is_none() && !given_up, position_time)
    }

    /// Who is too far from where it should be for too long falls.
    pub(super) fn watch_following(&mut self, objects: &mut Objects, errors: &mut Errors) {
        let window = objects.value(drive::FOLLOWING_WINDOW);
        let error = (self.demanded().position - self.axis.actual.position).abs();
        let far = self.state.is_powered() && window < WINDOW_OFF && error > window as f64;
        if !far {
            self.astray = None;
            return;
        }
        let since = *self.astray.get_or_insert(self.now);
        let most = Duration::from_millis(objects.value(drive::FOLLOWING_TIMEOUT) as u64);
        if self.now.since(since) >= most && self.state == State::OperationEnabled {
            self.fall(alarm::FOLLOWING_ERROR, objects, errors);
        }
    }
}

fn round(value: f64) -> i64 {
    value.round() as i64
}
