//! Motion, under current and in its mode.

use puente_drives::cia402::homing::{self, Method};
use puente_drives::cia402::object::{
    HOMING_METHOD, POSITION, PROFILE_VELOCITY, TARGET_POSITION, TARGET_TORQUE, TARGET_VELOCITY,
};
use puente_drives::cia402::position::{self, SetPoint};
use puente_drives::cia402::{Command, Controlword, Mode, Object, Statusword};
use puente_line::Instant;

use super::{Drive, HOMING_GRACE, Job, PRESET_CYCLES};
use crate::{Failure, Motion, Progress};

impl Drive {
    /// Moves.
    pub(super) fn run(
        &mut self,
        now: Instant,
        status: Statusword,
        mode: Mode,
        motion: Motion,
    ) -> Result<Progress, Failure> {
        // What has been halted stands before it moves again.
        if self.halted && self.begun && !self.comes_to_stand(now, status)? {
            return Ok(Progress::Running);
        }
        match motion {
            Motion::Position { target, velocity, relative, .. } if mode.is_cyclic() => {
                self.travel(now, status, mode, target, velocity, relative)
            }
            Motion::Position { target, velocity, relative, .. } => {
                if let Some(velocity) = velocity {
                    self.output.set(PROFILE_VELOCITY, velocity.into());
                }
                self.position(status, target, relative)
            }
            Motion::Velocity(value) if mode.is_cyclic() => Ok(self.follow(status, mode, value)),
            Motion::Torque(value) if mode.is_cyclic() => Ok(self.follow(status, mode, value.into())),
            Motion::Interpolate(value) => Ok(self.follow(status, mode, value)),
            Motion::Velocity(value) => Ok(self.let_go(status, TARGET_VELOCITY, value.into())),
            Motion::Torque(value) => Ok(self.let_go(status, TARGET_TORQUE, value.into())),
            Motion::Home { method, .. } => self.home(now, status, method),
            Motion::Mode(_) => Ok(Progress::Reached),
        }
    }

    pub(super) fn enabled(&mut self, bits: u16) {
        self.command(Controlword::of(Command::EnableOperation), bits);
    }

    /// The bits of a motion that begins with bit 4. Until then what is halted stays halted.
    fn edge(&mut self, bits: u16) {
        self.halted &= bits & Controlword::MODE_4 == 0;
        self.enabled(if self.halted { bits | Controlword::HALT } else { bits });
    }

    fn position(&mut self, status: Statusword, target: i32, relative: bool) -> Result<Progress, Failure> {
        if !self.taken {
            let base = match (relative, self.target.or(self.input.position)) {
                (false, _) => 0,
                (true, Some(base)) => base,
                (true, None) => {
                    self.ask(Job::known(POSITION));
                    return Ok(Progress::Running);
                }
            };
            let target = base.wrapping_add(target);
            // What it has still to get to, or was halted on the way to, is forgotten.
            let immediately = self.begun || self.halted;
            self.handshake.submit(SetPoint { immediately, ..SetPoint::absolute(target) });
            self.target = Some(target);
            self.preset = None;
            self.begun = true;
            self.taken = true;
        }
        if !self.output.is_told() {
            return Ok(Progress::Running);
        }
        let advice = self.handshake.advise(status);
        if let Some(target) = advice.target {
            self.output.set(TARGET_POSITION, target.into());
        }
        self.edge(advice.bits);
        match advice.progress {
            position::Progress::Reached => {
                self.begun = false;
                Ok(Progress::Reached)
            }
            position::Progress::FollowingError => Err(Failure::Following),
            _ => Ok(Progress::Running),
        }
    }

    /// A set-point that counts until there is another.
    fn let_go(&mut self, status: Statusword, object: Object, value: i64) -> Progress {
        self.output.set(object, value);
        self.begun = true;
        self.preset = None;
        self.halted = false;
        self.enabled(0);
        let there = self.is_current() && status.has(Statusword::TARGET_REACHED);
        if there { Progress::Reached } else { Progress::Running }
    }

    /// A set-point of the cyclic mode. The first counts when where it stands has been told.
    fn follow(&mut self, status: Statusword, mode: Mode, value: i32) -> Progress {
        if !self.begun {
            if !self.is_preset(mode) || self.streamed < PRESET_CYCLES {
                return Progress::Running;
            }
            self.begun = true;
            self.preset = None;
            self.halted = false;
        }
        self.travel = None;
        self.set_point = value;
        self.enabled(mode.run_bits());
        if self.output.is_told() && status.has(Statusword::MODE_12) {
            Progress::Reached
        } else {
            Progress::Running
        }
    }

    fn home(
        &mut self,
        now: Instant,
        status: Statusword,
        method: Option<Method>,
    ) -> Result<Progress, Failure> {
        if let Some(method) = method {
            self.output.set(HOMING_METHOD, method.number().into());
        }
        let Some(number) = method.map(|method| method.number().into()).or(self.output.known(HOMING_METHOD))
        else {
            self.ask(Job::noted(HOMING_METHOD));
            return Ok(Progress::Running);
        };
        if !self.output.is_told() {
            return Ok(Progress::Running);
        }
        if !self.taken {
            let method = i8::try_from(number).ok().and_then(Method::new).ok_or(Failure::Homing)?;
            self.homing.start(method);
            self.homed = false;
            self.preset = None;
            self.begun = true;
            self.taken = true;
            self.target = None;
        }
        let advice = self.homing.advise(now, status);
        self.edge(advice.bits);
        match advice.progress {
            homing::Progress::Complete => {
                self.begun = false;
                self.homed = true;
                Ok(Progress::Reached)
            }
            homing::Progress::Failed => {
                self.begun = false;
                Err(Failure::Homing)
            }
            _ => {
                self.wake_at(now + HOMING_GRACE);
                Ok(Progress::Running)
            }
        }
    }
}
