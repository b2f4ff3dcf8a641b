//! With current and without.

use puente_drives::cia402::{Command, Controlword, Goal, Mode, Progress as Power, State, Statusword, object};
use puente_line::Instant;

use super::{CYCLIC_STAND, Drive, PRESET_CYCLES, QUICK_STOP, REPEAT, SETTLE, STAND, STUCK};
use crate::{Failure, Motion, Node, Order, Progress, Why};

impl Drive {
    /// Goes for what is wanted.
    pub(super) fn pursue(&mut self, now: Instant) -> Progress {
        if self.node != Node::Present {
            self.examine(now);
            return if self.order == Order::Observe { Progress::Idle } else { Progress::Running };
        }
        let (Some(status), Some(state)) = (self.input.status, self.input.state()) else {
            return if self.order == Order::Observe { Progress::Idle } else { Progress::Running };
        };
        let motion = match self.order {
            Order::Observe => return Progress::Idle,
            Order::Off => return self.seek(now, status, state, Goal::Off),
            Order::Stop => return self.seek(now, status, state, Goal::QuickStopped),
            Order::Reset { .. } => return self.seek(now, status, state, Goal::Reset),
            Order::Hold => None,
            Order::Move(motion) => Some(motion),
        };
        if matches!(state, State::Fault | State::FaultReactionActive) {
            self.fall(Why::Fault(self.fault.or(self.emergency)));
            return Progress::Idle;
        }
        if self.engaged && state != State::OperationEnabled {
            self.fall(Why::Left(state));
            return Progress::Idle;
        }
        match self.under_current(now, status, state, motion) {
            Ok(progress) => progress,
            Err(failure) => {
                if self.begun && state == State::OperationEnabled {
                    self.halt(now);
                }
                Progress::Failed(failure)
            }
        }
    }

    /// Takes it to where it is without current, or stops.
    fn seek(&mut self, now: Instant, status: Statusword, state: State, goal: Goal) -> Progress {
        // An edge has been told before it goes on.
        if goal == Goal::Reset && !self.output.is_told() && self.output.told().is_some() {
            return Progress::Running;
        }
        let hurried = self.hurried(now, state, goal);
        if hurried != self.machine.goal() {
            self.machine.set_goal(hurried);
        }
        let mut advice = self.machine.advise(status);
        if goal == Goal::Reset && self.output.told() == Some(advice.word) {
            advice = self.machine.advise(status);
        }
        self.command(advice.word, 0);
        match advice.progress {
            Power::Reached if !self.is_current() => Progress::Running,
            Power::Reached => Progress::Reached,
            Power::Fault => Progress::Failed(Failure::Fault(self.fault)),
            Power::Local => Progress::Failed(Failure::Local),
            Power::Preset | Power::OnTheWay | Power::Unknown => self.on_the_way(now, state),
        }
    }

    /// A quick stop of which a drive never says that it is over does not keep it from being switched off.
    fn hurried(&mut self, now: Instant, state: State, goal: Goal) -> Goal {
        let leaves = matches!(goal, Goal::Off | Goal::Enabled | Goal::Reset);
        match self.quick_stop_since.filter(|_| leaves && state == State::QuickStopActive) {
            Some(since) if self.passed(now, since, QUICK_STOP) => Goal::Unpowered,
            _ => goal,
        }
    }

    /// A word was told; it is told again where nothing comes of it.
    fn on_the_way(&mut self, now: Instant, state: State) -> Progress {
        let told_at = self.output.told_at();
        if self.output.is_told() && self.passed(now, told_at, REPEAT) {
            self.output.repeat();
        }
        let since = self.since;
        if self.passed(now, since, STUCK) {
            return match state {
                State::Fault | State::FaultReactionActive => Progress::Failed(Failure::Fault(self.fault)),
                state => Progress::Failed(Failure::Stuck(state)),
            };
        }
        Progress::Running
    }

    /// Takes it to where it is under current in the right mode, and lets it move there.
    fn under_current(
        &mut self,
        now: Instant,
        status: Statusword,
        state: State,
        motion: Option<Motion>,
    ) -> Result<Progress, Failure> {
        let mode = self.mode_for(motion)?;
        if let Some(trouble) = self.trouble {
            return Err(trouble);
        }
        if state != State::OperationEnabled {
            return self.enable(now, status, state, mode);
        }
        if !self.engaged {
            return Ok(self.take_over(now));
        }
        if self.input.mode != Some(mode) {
            return self.change_mode(now, status, mode);
        }
        self.mode_since = None;
        match motion {
            None | Some(Motion::Mode(_)) => self.rest(now, status),
            Some(motion) => self.run(now, status, mode, motion),
        }
    }

    /// The mode for a motion, or for standing.
    fn mode_for(&self, motion: Option<Motion>) -> Result<Mode, Failure> {
        let cyclic = self.axis.cyclic();
        let either = |own: Mode, other| if cyclic == Some(own) { own } else { other };
        let mode = match motion {
            None => match self.input.mode {
                Some(mode) if self.stands_in(mode) && (self.engaged || self.axis.travels().is_none()) => mode,
                _ => self.axis.travels().unwrap_or(Mode::ProfilePosition),
            },
            Some(Motion::Position { .. }) => self.axis.travels().unwrap_or(Mode::ProfilePosition),
            Some(Motion::Velocity(_)) => either(Mode::CyclicVelocity, Mode::ProfileVelocity),
            Some(Motion::Torque(_)) => either(Mode::CyclicTorque, Mode::ProfileTorque),
            Some(Motion::Home { .. }) => Mode::Homing,
            Some(Motion::Interpolate(_)) => either(Mode::CyclicPosition, Mode::InterpolatedPosition),
            Some(Motion::Mode(mode)) => mode,
        };
        if !self.axis.profile.has(mode) || mode.is_cyclic() && cyclic != Some(mode) {
            return Err(Failure::NoMode(mode));
        }
        if mode.is_cyclic() && self.sync.is_zero() {
            return Err(Failure::NoSync);
        }
        Ok(mode)
    }

    /// Whether it can be left in a mode to stand there. A torque of nothing holds nothing.
    fn stands_in(&self, mode: Mode) -> bool {
        match mode {
            Mode::ProfilePosition | Mode::ProfileVelocity | Mode::Homing => self.axis.profile.has(mode),
            Mode::InterpolatedPosition | Mode::CyclicPosition | Mode::CyclicVelocity => {
                self.axis.cyclic() == Some(mode) && !self.sync.is_zero() && self.axis.profile.has(mode)
            }
            _ => false,
        }
    }

    /// Takes it under current, a step at a time: the mode is shown and the set-points are preset before the last one.
    fn enable(
        &mut self,
        now: Instant,
        status: Statusword,
        state: State,
        mode: Mode,
    ) -> Result<Progress, Failure> {
        let goal = self.hurried(now, state, Goal::Enabled);
        if goal != self.machine.goal() {
            self.machine.set_goal(goal);
        }
        let advice = self.machine.advise(status);
        match advice.progress {
            Power::Preset => {
                self.command(advice.word, 0);
                if self.input.mode != Some(mode) {
                    self.preset = None;
                    return self.await_mode(now, mode);
                }
                self.mode_since = None;
                if !self.is_preset(mode) || mode.is_cyclic() && self.streamed < PRESET_CYCLES {
                    return Ok(Progress::Running);
                }
                self.machine.set_preset();
                let advice = self.machine.advise(status);
                self.command(advice.word, 0);
            }
            Power::Local => return Err(Failure::Local),
            Power::Fault => return Err(Failure::Fault(self.fault)),
            Power::Reached | Power::OnTheWay | Power::Unknown => self.command(advice.word, 0),
        }
        Ok(self.on_the_way(now, state))
    }

    /// It is under current, but not by this master's command, or not for all that is known: it is halted.
    fn take_over(&mut self, now: Instant) -> Progress {
        if self.is_preset(self.input.mode.unwrap_or(Mode::None)) {
            self.begun = true;
            self.halt(now);
        }
        Progress::Running
    }

    /// Changes the mode under current, at standstill.
    fn change_mode(&mut self, now: Instant, status: Statusword, mode: Mode) -> Result<Progress, Failure> {
        if self.begun && !self.comes_to_stand(now, status)? {
            return Ok(Progress::Running);
        }
        if !self.is_preset(mode) {
            return Ok(Progress::Running);
        }
        self.target = None;
        self.await_mode(now, mode)
    }

    /// Under current, and standing.
    pub(super) fn rest(&mut self, now: Instant, status: Statusword) -> Result<Progress, Failure> {
        if self.begun && !self.comes_to_stand(now, status)? {
            return Ok(Progress::Running);
        }
        let bits = if self.halted { Controlword::HALT } else { 0 };
        self.command(Controlword::of(Command::EnableOperation), bits);
        Ok(if self.output.is_told() { Progress::Reached } else { Progress::Running })
    }

    /// Halts it. What it was to do is forgotten, so that nothing goes on when the halt is over.
    pub(super) fn halt(&mut self, now: Instant) {
        if !self.halted || self.halt_since.is_none() {
            self.halted = true;
            self.halt_since = Some(now);
            self.preset = None;
            self.stands_at = None;
        }
        match self.input.mode {
            Some(Mode::ProfileVelocity) => self.output.set(object::TARGET_VELOCITY, 0),
            Some(Mode::ProfileTorque) => self.output.set(object::TARGET_TORQUE, 0),
            Some(Mode::CyclicVelocity | Mode::CyclicTorque) => self.set_point = 0,
            _ => {}
        }
        self.target = None;
        self.travel = None;
        self.handshake.clear();
        self.homing.cancel();
        self.command(Controlword::of(Command::EnableOperation), Controlword::HALT);
    }

    /// Halts it, or lets it slow down on its way; whether it stands.
    pub(super) fn comes_to_stand(&mut self, now: Instant, status: Statusword) -> Result<bool, Failure> {
        if let Some(stands) = self.slows_down() {
            return Ok(stands);
        }
        self.halt(now);
        if !self.output.is_told() {
            return Ok(false);
        }
        let since = self.output.told_at();
        let settled = self.passed(now, since, SETTLE);
        let stands = match self.input.mode {
            Some(Mode::ProfileVelocity) => settled && status.has(Statusword::MODE_12),
            // Not all say then that they stand.
            Some(Mode::InterpolatedPosition) => {
                let inactive = !status.has(Statusword::MODE_12);
                let reached = settled && status.has(Statusword::TARGET_REACHED);
                inactive && (reached || self.passed(now, since, CYCLIC_STAND))
            }
            Some(Mode::CyclicPosition | Mode::CyclicVelocity | Mode::CyclicTorque) => {
                self.passed(now, since, CYCLIC_STAND)
            }
            _ => settled && status.has(Statusword::TARGET_REACHED),
        };
        if stands {
            self.begun = false;
            self.halt_since = None;
            return Ok(true);
        }
        let since = self.halt_since.unwrap_or(now);
        if self.passed(now, since, STAND) { Err(Failure::Moving) } else { Ok(false) }
    }
}
