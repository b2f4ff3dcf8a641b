//! A servo drive of CiA 402, from its own point of view, with the axis that it moves.
//!
//! Demands are computed in closed form; the motor follows them with a lag, in steps of [`STEP`] at most. Whoever looks at the
//! drive lets it catch up with the time first.

mod alarm;
mod axis;
mod course;
mod homing;
mod machine;
mod motion;
mod objects;
mod power;
mod status;

use std::time::Duration;

use alarm::Alarm;
use axis::Axis;
pub use axis::AxisConfig;
use course::{Course, Limits, Point};
use homing::Homing;
use motion::SetPoint;
use puente_canopen::Address;
use puente_drives::cia402::object::{self as drive, Object};
use puente_drives::cia402::{Mode, Profile, State};
use puente_line::{Instant, micros};

use super::fault::DriveFault;
use super::node::{Errors, Model, Objects};

/// The longest step of the servo.
const STEP: Duration = Duration::from_micros(250);
/// A drive that moves is looked at so often.
const LOOK: Duration = Duration::from_millis(1);

/// What follows when the axis stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum After {
    /// Another state.
    State(State),
    /// It is held.
    Hold,
}

/// What has come of interpolated and cyclic set-points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cycles {
    /// SYNCs while the drive followed set-points.
    pub syncs: u64,
    /// Of those, how many brought no new set-point.
    pub missed: u64,
}

/// A drive.
#[derive(Debug)]
pub struct Drive {
    model: Model,
    profile: &'static Profile,
    axis: Axis,
    now: Instant,
    state: State,
    mode: Mode,
    control: u16,
    /// Where its position is 0, from the machine's zero.
    zero: f64,
    homed: bool,
    /// The demand, and the seconds since it began.
    course: Course,
    since: f64,
    /// It goes under current, and is there then.
    enabling: Option<Instant>,
    after: Option<After>,
    alarm: Option<Alarm>,
    hot: bool,
    /// Where the last set-point was, from the machine's zero.
    target: f64,
    set_point: Option<SetPoint>,
    /// One more, that waits for the first.
    next: Option<SetPoint>,
    acknowledged: bool,
    /// Interpolation goes on.
    active: bool,
    /// A set-point has come since the last SYNC.
    fresh: bool,
    cycles: Cycles,
    period: f64,
    /// Of the rated torque: the demand, and what it shall come to.
    torque: f64,
    target_torque: f64,
    homing: Homing,
    /// A limit switch or software limit has stopped it.
    limited: bool,
    /// Since when it is where it should be, and whether for long enough.
    in_window: Option<Instant>,
    reached: bool,
    /// Whether it is there has not been looked at yet.
    unsettled: bool,
    /// Since when it is too far from its demand.
    astray: Option<Instant>,
}

impl Drive {
    /// A drive that is switched on at the start of the clock.
    pub fn new(model: Model, profile: &'static Profile, axis: AxisConfig, objects: &mut Objects) -> Self {
        objects::define(objects, model);
        let axis = Axis::new(axis);
        let mut drive = Self {
            model,
            profile,
            now: Instant::ZERO,
            state: State::SwitchOnDisabled,
            mode: Mode::None,
            control: 0,
            zero: 0.0,
            homed: false,
            course: Course::standing(axis.actual.position),
            since: 0.0,
            enabling: None,
            after: None,
            alarm: None,
            hot: false,
            target: axis.actual.position,
            set_point: None,
            next: None,
            acknowledged: false,
            active: false,
            fresh: false,
            cycles: Cycles::default(),
            period: 0.001,
            torque: 0.0,
            target_torque: 0.0,
            homing: Homing::default(),
            limited: false,
            in_window: None,
            reached: false,
            unsettled: false,
            astray: None,
            axis,
        };
        drive.start(Instant::ZERO, objects);
        drive
    }

    /// Its state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Its mode of operation.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Where the carriage is from the drive's zero, position units.
    pub fn position(&self) -> f64 {
        self.axis.actual.position - self.zero
    }

    /// The same from the machine's zero, which no homing moves.
    pub fn machine_position(&self) -> f64 {
        self.axis.actual.position
    }

    /// Where it should be.
    pub fn demand(&self) -> f64 {
        self.demanded().position - self.zero
    }

    /// Position units a second.
    pub fn velocity(&self) -> f64 {
        self.axis.actual.velocity
    }

    /// Whether it has found home since it was switched on.
    pub fn is_homed(&self) -> bool {
        self.homed
    }

    /// What has come of interpolated and cyclic set-points.
    pub fn cycles(&self) -> Cycles {
        self.cycles
    }

    fn demanded(&self) -> Point {
        self.course.at(self.since)
    }

    /// Begins another demand.
    fn go(&mut self, course: Course) {
        self.course = course;
        self.since = 0.0;
    }

    fn is_there(&self) -> bool {
        self.since >= self.course.seconds()
    }

    /// Whether the demand has come to its end and stands.
    fn stands(&self) -> bool {
        self.is_there() && self.course.end().velocity == 0.0
    }

    /// A value in position units, from the machine's zero.
    fn in_machine(&self, position: i64) -> f64 {
        position as f64 + self.zero
    }

    /// When it has to be looked at.
    pub(super) fn poll_at(&self) -> Option<Instant> {
        (!self.at_rest()).then(|| self.now + LOOK)
    }

    /// Whether nothing changes by itself.
    fn at_rest(&self) -> bool {
        let quiet = self.enabling.is_none() && self.after.is_none() && !self.homing.is_running();
        if !self.state.is_powered() {
            return quiet && self.axis.actual.velocity == 0.0;
        }
        let torques = [self.torque, self.target_torque, self.axis.actual.velocity];
        let pushed = self.mode_is_torque() && torques.iter().any(|torque| *torque != 0.0);
        let still = self.stands() && self.axis.actual == self.course.end();
        let settled = !self.unsettled && (self.reached || self.in_window.is_none());
        quiet && !pushed && still && settled && self.next.is_none() && !self.acknowledgement_pends()
    }

    /// Lets it catch up with the time; whether anything may have changed.
    pub(super) fn advance(&mut self, now: Instant, objects: &mut Objects, errors: &mut Errors) -> bool {
        if now <= self.now {
            return false;
        }
        if self.at_rest() {
            self.now = now;
            return false;
        }
        while self.now < now {
            let step = now.since(self.now).min(STEP);
            self.step(step, objects, errors);
        }
        self.publish(objects);
        true
    }

    fn step(&mut self, step: Duration, objects: &mut Objects, errors: &mut Errors) {
        self.now += step;
        let seconds = micros(step) as f64 / 1e6;
        let before = self.axis.actual.position;
        if !self.state.is_powered() {
            self.axis.coast(seconds);
        } else if self.mode_is_torque() && self.after.is_none() {
            self.push(seconds, objects);
        } else {
            let acceleration = self.course.acceleration(self.since);
            let from = self.demanded();
            self.since += seconds;
            self.axis.follow(from, self.demanded(), acceleration, seconds);
        }
        self.finish_enabling();
        self.finish_stop(objects);
        if self.state == State::OperationEnabled && self.after.is_none() {
            if self.homing.is_running() {
                self.home(before, objects);
            } else {
                self.respect_limits(objects, errors);
                self.go_on(objects);
            }
        }
        self.watch_following(objects, errors);
        self.watch_window(objects);
    }

    /// Objects have been written, all of them before the drive looks at any.
    pub(super) fn written(
        &mut self,
        now: Instant,
        written: &[Address],
        objects: &mut Objects,
        errors: &mut Errors,
    ) {
        self.advance(now, objects, errors);
        let has = |object: Object| written.contains(&object.address);
        if has(drive::MODE) {
            self.change_mode(objects);
        }
        if has(drive::CONTROLWORD) {
            self.take_control(objects, errors);
        }
        if has(drive::INTERPOLATION_SET_POINT) {
            self.interpolate(objects);
        }
        if has(drive::TARGET_POSITION) || has(drive::TARGET_VELOCITY) || has(drive::TARGET_TORQUE) {
            self.take_target(objects);
        }
        if has(drive::PERIOD_VALUE) || has(drive::PERIOD_EXPONENT) {
            self.take_period(objects, false);
        }
        self.publish(objects);
    }

    /// SYNC: the set-points that waited for it have been written.
    pub(super) fn sync(&mut self, objects: &mut Objects) {
        let follows = self.interpolates() || self.follows_cyclically();
        if follows {
            self.cycles.syncs += 1;
            self.cycles.missed += u64::from(!self.fresh);
        }
        self.fresh = false;
        self.publish(objects);
    }

    /// Something is wrong from now on, or no more.
    pub(super) fn suffer(
        &mut self,
        now: Instant,
        fault: DriveFault,
        objects: &mut Objects,
        errors: &mut Errors,
    ) {
        self.advance(now, objects, errors);
        match fault {
            DriveFault::Blocked(blocked) => self.axis.blocked = blocked,
            DriveFault::Hot(hot) => self.hot = hot,
            _ => {}
        }
        if let Some(alarm) = Alarm::of(fault, self.model) {
            self.fall(alarm, objects, errors);
        }
        self.publish(objects);
    }

    /// How fast a profile may go.
    fn limits(&self, objects: &Objects) -> Limits {
        let above_zero = |object| (objects.value(object) as f64).max(1.0);
        let most = above_zero(drive::MAX_PROFILE_VELOCITY);
        Limits {
            velocity: above_zero(drive::PROFILE_VELOCITY).min(most),
            acceleration: above_zero(drive::PROFILE_ACCELERATION),
            deceleration: above_zero(drive::PROFILE_DECELERATION),
        }
    }
}
