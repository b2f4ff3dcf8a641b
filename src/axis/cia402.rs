//! The axis commands of a CiA 402 drive: each changes what is wanted in the process image, and waits until the drive reports
//! that it is so, or on its way.
//!
//! Positions, velocities and accelerations are in the drive's own units, torques in thousandths of the rated one.

use core::fmt::Write;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use puente_drives::cia402::homing::Method;
use puente_drives::cia402::{Mode, Profile, State};
use puente_line::Duration;
use puente_modbus::Evidence;
use puente_servos::{Failure as Unable, Motion as Moves, Node, Progress, Report};

use super::{Axes, AxisError, Commander, Course, Drive as AnyDrive};
use crate::clock;
use crate::desk::{Desk, Failure, Feedback, Motion, Permit, Reason, View, Wish};

/// A drive tells within this time that it has come to its state, or why it does not: what drives it gives up earlier.
const CHANGE: Duration = Duration::from_secs(10);
/// The bus has seen what is wanted within this time.
const SEEN: Duration = Duration::from_secs(1);

/// What the configuration says of a drive.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// What kind it is.
    pub profile: &'static Profile,
    /// Its bus has SYNC by this gateway.
    pub sync: bool,
    /// The mode whose set-points come with SYNC, alone in its receive PDO 4.
    pub cyclic: Option<Mode>,
}

/// A drive as the axis keeps it.
pub(super) struct Drive {
    pub(super) spec: Spec,
    serial: AtomicU32,
}

/// A drive in the process image.
pub(super) struct Servo<'a> {
    pub(super) desk: &'a Desk,
    pub(super) axis: u8,
    pub(super) bus: u8,
    pub(super) drive: &'a Drive,
}

/// What a command waits for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Awaited {
    /// The bus has seen that nothing is wanted.
    LetGo,
    /// Under current, at rest.
    Held,
    /// On its way, or there already.
    Moving(Moves),
    /// A stop has come to its end.
    Rest,
    /// Without current.
    Off,
    /// Out of its fault.
    Cleared,
}

impl Drive {
    pub(super) const fn new(spec: Spec) -> Self {
        Self { spec, serial: AtomicU32::new(0) }
    }

    /// A number that no command before has had.
    fn serial(&self) -> u32 {
        self.serial.fetch_add(1, Relaxed).wrapping_add(1)
    }
}

impl Awaited {
    /// Whether it has come about, or why it will not.
    fn found(self, view: &View, spec: &Spec) -> Option<Result<(), AxisError>> {
        let (_, report) = view.servo()?;
        if report.node != Node::Present {
            return Some(Err(AxisError::Node(report.node)));
        }
        let wanted = match self {
            Awaited::LetGo => match view.wish {
                Wish::Observe if faulty(&report) => return Some(Err(fault(&report))),
                Wish::Observe => return view.shown.then_some(Ok(())),
                _ => false,
            },
            Awaited::Held => match view.wish {
                Wish::Hold => false,
                _ => return Some(Err(fallen(&report))),
            },
            Awaited::Moving(motion) => match view.wish {
                Wish::Move(Motion::Servo(now), _) if now == motion => false,
                // It has arrived, or its commander has sent it elsewhere.
                Wish::Hold | Wish::Move(..) => true,
                _ => return Some(Err(fallen(&report))),
            },
            Awaited::Rest => !matches!(view.wish, Wish::Stop | Wish::Off),
            Awaited::Off => view.wish != Wish::Off,
            Awaited::Cleared => match view.wish {
                Wish::Clear(_) => false,
                _ if faulty(&report) => return Some(Err(fault(&report))),
                _ => true,
            },
        };
        if wanted {
            return Some(Ok(()));
        }
        let answer = view.answer().and_then(Feedback::servo)?;
        match (answer.progress, self) {
            // It is told when nothing is wanted any more.
            (Progress::Failed(_), Awaited::Cleared | Awaited::LetGo) => None,
            (Progress::Failed(failure), _) => Some(Err(unable(&answer, failure))),
            (Progress::Reached, Awaited::Held | Awaited::Moving(_)) => Some(Ok(())),
            (Progress::Running, Awaited::Moving(motion)) => in_mode(&answer, motion, spec).then_some(Ok(())),
            _ => None,
        }
    }
}

impl Servo<'_> {
    fn view(&self) -> View {
        self.desk.view(clock::now(), self.axis)
    }

    /// Whether orders reach it, or why not. To be asked before the lease: what does not hear is being stopped, too, and that is
    /// not the cause.
    pub(super) fn reached(&self) -> Result<(), AxisError> {
        let (_, report) = self.status()?.servo().ok_or(AxisError::Node(Node::Absent))?;
        if report.node == Node::Present { Ok(()) } else { Err(AxisError::Node(report.node)) }
    }

    /// Waits for one of these, no longer than it may take.
    async fn confirm(&self, awaited: Awaited) -> Result<(), AxisError> {
        if self.desk.line_down(self.bus) {
            return Err(LINE_DOWN);
        }
        let most = if awaited == Awaited::LetGo { SEEN } else { CHANGE };
        let found = self.desk.until(self.axis, most, |view| awaited.found(view, &self.drive.spec)).await;
        found.unwrap_or_else(|| Err(self.silent()))
    }

    /// Why a drive that should have reported has not.
    fn silent(&self) -> AxisError {
        match self.view().servo() {
            _ if self.desk.line_down(self.bus) => LINE_DOWN,
            None => AxisError::Node(Node::Absent),
            Some((_, report)) => match report.state() {
                Some(state) => unable(&report, Unable::Stuck(state)),
                None => AxisError::Failure(Failure::NoReply(Evidence::Silence)),
            },
        }
    }

    /// What it has said last. It says when something changes, so that what is old may be true.
    pub(super) fn status(&self) -> Result<View, AxisError> {
        let view = self.view();
        match view.servo() {
            _ if self.desk.line_down(self.bus) => Err(LINE_DOWN),
            None => Err(AxisError::Node(Node::Absent)),
            Some(_) => Ok(view),
        }
    }

    /// Puts it under current, at standstill where it is. An axis that is under way stops.
    pub(super) async fn enable(&self, permit: Permit) -> Result<(), AxisError> {
        if !matches!(self.view().wish, Wish::Hold | Wish::Move(..)) {
            // What was taken back does not count before nothing has been wanted.
            self.confirm(Awaited::LetGo).await?;
        }
        if !self.desk.hold(clock::now(), permit) {
            return Err(STOPPED);
        }
        let result = self.confirm(Awaited::Held).await;
        if result.is_err() && self.view().wish == Wish::Hold {
            // It must not come on later.
            self.desk.switch_off(clock::now(), self.axis);
        }
        result
    }

    /// Takes the current away; what moves is stopped first, as the drive is set to.
    pub(super) async fn off(&self) -> Result<(), AxisError> {
        self.desk.switch_off(clock::now(), self.axis);
        self.confirm(Awaited::Off).await
    }

    /// A quick stop. It is wanted until it has come about, also of a drive that is not there.
    pub(super) async fn stop(&self) -> Result<(), AxisError> {
        self.desk.quick_stop(clock::now(), self.axis);
        self.confirm(Awaited::Rest).await
    }

    /// Out of its fault, and without current.
    pub(super) async fn clear(&self, permit: Permit) -> Result<(), AxisError> {
        if !self.desk.reset(clock::now(), permit, self.drive.serial()) {
            return Err(STOPPED);
        }
        self.confirm(Awaited::Cleared).await
    }

    /// Moves it, under the lease of this permit. Resolves when it is on its way.
    async fn go(&self, permit: Permit, motion: Moves) -> Result<(), AxisError> {
        if !matches!(self.view().wish, Wish::Hold | Wish::Move(..)) {
            self.desk.unlease(permit);
            let report = self.view().servo().map(|(_, report)| report);
            return Err(match report {
                Some(report) if report.node != Node::Present => AxisError::Node(report.node),
                Some(report) if faulty(&report) => fault(&report),
                _ => AxisError::NotEnabled,
            });
        }
        if !self.desk.go(clock::now(), permit, Motion::Servo(motion)) {
            return Err(STOPPED);
        }
        // Where nothing is heard the lease stays, so that its end stops the axis.
        let result = self.confirm(Awaited::Moving(motion)).await;
        if let Err(AxisError::Drive(..)) = result
            && self.desk.hold(clock::now(), permit)
        {
            self.desk.release(permit);
        }
        result
    }

    /// What is wanted of it, where it moves.
    fn moves(&self) -> Option<Moves> {
        match self.view().wish {
            Wish::Move(Motion::Servo(motion), _) => Some(motion),
            _ => None,
        }
    }

    /// To a position. What only renews a move to the same is none.
    pub(super) async fn position(
        &self,
        permit: Permit,
        Course { position: target, velocity }: Course,
        renews: bool,
    ) -> Result<(), AxisError> {
        let motion = |serial| Moves::Position { target, velocity, relative: false, serial };
        let same = match self.moves() {
            Some(now @ Moves::Position { serial, .. }) if renews => now == motion(serial),
            _ => false,
        };
        if same { Ok(()) } else { self.go(permit, motion(self.drive.serial())).await }
    }
}

/// A stop, or the end of the lease, came first.
const STOPPED: AxisError = AxisError::Failure(Failure::NotSent(Reason::Stopped));
const LINE_DOWN: AxisError = AxisError::Failure(Failure::NotSent(Reason::LineDown));

const NO_HOMING: &str = "only a CiA 402 drive finds home by itself";
const NO_VELOCITY: &str =
    "only a CiA 402 drive takes a velocity in its own units; an EDB drive: jog, a PID module: move";
const NO_TORQUE: &str = "only a CiA 402 drive takes a torque";
const NO_MODE: &str = "only a CiA 402 drive has modes";

impl Axes {
    pub(super) fn servo<'a>(&'a self, axis: u8, bus: u8, drive: &'a Drive) -> Servo<'a> {
        Servo { desk: self.desk, axis, bus, drive }
    }

    /// Moves a drive under the lease of its commander.
    async fn drive(
        &self,
        id: u8,
        by: Commander,
        hold: Option<Duration>,
        lacks: &'static str,
        motion: impl FnOnce(u32) -> Moves,
    ) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let AnyDrive::Cia402(drive) = &axis.drive else { return Err(AxisError::Unsupported(lacks)) };
        let servo = self.servo(id, axis.bus, drive);
        servo.reached()?;
        let permit = self.desk.lease(clock::now(), id, by.holder, hold)?;
        let _turn = axis.turn.lock().await;
        servo.go(permit, motion(drive.serial())).await
    }

    /// Sends the axis home, by the drive's own method or by this one. It takes its time, in which its commander shows life;
    /// what has found home needs nobody any more. Takes the lease as [`jog`](Self::jog) does; to `renew` only shows life.
    pub async fn home(
        &self,
        id: u8,
        by: Commander,
        method: Option<Method>,
        hold: Option<Duration>,
        renew: bool,
    ) -> Result<(), AxisError> {
        if renew {
            let permit = self.desk.prolong(clock::now(), id, by.holder, hold)?;
            return permit.map_or_else(|| self.arrived(id), |_| Ok(()));
        }
        self.drive(id, by, hold, NO_HOMING, |serial| Moves::Home { method, serial }).await
    }

    /// Life is shown for a motion without a lease: that is well where it has come to its end by itself.
    pub(super) fn arrived(&self, id: u8) -> Result<(), AxisError> {
        let view = self.desk.view(clock::now(), id);
        if view.servo().is_some() && view.wish == Wish::Hold { Ok(()) } else { Err(STOPPED) }
    }

    /// Turns the axis at a velocity, in the drive's velocity units, while its commander shows life; 0 lets it stand, under
    /// current and under the lease. Takes the lease as [`jog`](Self::jog) does.
    pub async fn velocity(
        &self,
        id: u8,
        by: Commander,
        velocity: i32,
        hold: Option<Duration>,
    ) -> Result<(), AxisError> {
        self.drive(id, by, hold, NO_VELOCITY, |_| Moves::Velocity(velocity)).await
    }

    /// Drives the axis with a torque, in thousandths of the rated one, while its commander shows life. Takes the lease as
    /// [`jog`](Self::jog) does.
    pub async fn torque(
        &self,
        id: u8,
        by: Commander,
        permille: i16,
        hold: Option<Duration>,
    ) -> Result<(), AxisError> {
        self.drive(id, by, hold, NO_TORQUE, |_| Moves::Torque(permille)).await
    }

    /// Takes the drive to a mode, in which nothing moves by that. In those that hold no position, and in a manufacturer's, it
    /// stays under the lease.
    pub async fn mode(
        &self,
        id: u8,
        by: Commander,
        mode: Mode,
        hold: Option<Duration>,
    ) -> Result<(), AxisError> {
        self.drive(id, by, hold, NO_MODE, |_| Moves::Mode(mode)).await
    }
}

/// Whether a drive is in the mode of a motion.
fn in_mode(report: &Report, motion: Moves, spec: &Spec) -> bool {
    let modes: &[Mode] = match motion {
        Moves::Position { .. } if spec.cyclic.is_some() => {
            &[Mode::InterpolatedPosition, Mode::CyclicPosition]
        }
        Moves::Position { .. } => &[Mode::ProfilePosition],
        Moves::Velocity(_) => &[Mode::ProfileVelocity, Mode::CyclicVelocity],
        Moves::Torque(_) => &[Mode::ProfileTorque, Mode::CyclicTorque],
        Moves::Home { .. } => &[Mode::Homing],
        Moves::Interpolate(_) => &[Mode::InterpolatedPosition, Mode::CyclicPosition],
        // There is nothing more to it.
        Moves::Mode(_) => &[],
    };
    report.mode.is_some_and(|mode| modes.contains(&mode))
}

pub(super) fn faulty(report: &Report) -> bool {
    matches!(report.state(), Some(State::Fault | State::FaultReactionActive))
}

/// The fault that a drive is in.
pub(super) fn fault(report: &Report) -> AxisError {
    let told = report.emergency.map(|emergency| emergency.code);
    AxisError::DriveFault(report.fault.or(told))
}

/// Why nothing is wanted any more.
fn fallen(report: &Report) -> AxisError {
    if faulty(report) { fault(report) } else { STOPPED }
}

/// Why a drive does not do what is wanted.
fn unable(report: &Report, failure: Unable) -> AxisError {
    match failure {
        Unable::Fault(_) => fault(report),
        failure => AxisError::Drive(failure, report.state()),
    }
}

/// Whether an axis turns: it is under current, by its own word, and says a velocity. One that says none, as where moves are
/// made of set-points, is taken to turn while it is on its way, or stops.
pub(super) fn turns(view: &View) -> bool {
    let Some((_, report)) = view.servo() else { return false };
    let Some(state) = report.state().filter(|state| powered(*state)) else { return false };
    match report.velocity {
        Some(velocity) => velocity != 0,
        None => report.progress == Progress::Running || state != State::OperationEnabled,
    }
}

/// Whether a drive is under current in this state.
pub const fn powered(state: State) -> bool {
    matches!(state, State::OperationEnabled | State::QuickStopActive | State::FaultReactionActive)
}

/// Whether a drive is in a fault in this state.
pub const fn faulted(state: State) -> bool {
    matches!(state, State::FaultReactionActive | State::Fault)
}

/// The name of a state, as clients see it.
pub const fn state(state: State) -> &'static str {
    match state {
        State::NotReadyToSwitchOn => "not-ready-to-switch-on",
        State::SwitchOnDisabled => "switch-on-disabled",
        State::ReadyToSwitchOn => "ready-to-switch-on",
        State::SwitchedOn => "switched-on",
        State::OperationEnabled => "operation-enabled",
        State::QuickStopActive => "quick-stop-active",
        State::FaultReactionActive => "fault-reaction-active",
        State::Fault => "fault",
    }
}

/// The name of what a node is at, as clients see it.
pub const fn node(node: &Node) -> &'static str {
    match node {
        Node::Absent => "absent",
        Node::Booting => "booting",
        Node::Present => "present",
        Node::Lost => "lost",
        Node::Duplicate => "duplicate",
        Node::Refused(_) | Node::Unfit(_) | Node::Period { .. } | Node::Unread { .. } => "refused",
    }
}

/// How far a drive is, as clients see it.
pub const fn progress(progress: Progress) -> &'static str {
    match progress {
        Progress::Idle => "idle",
        Progress::Running => "running",
        Progress::Reached => "reached",
        Progress::Failed(_) => "failed",
    }
}

/// A mode by its letters, or by its number.
pub fn mode(text: &str) -> Option<Mode> {
    let is = |mode: &Mode| {
        let mut name = heapless::String::<8>::new();
        write!(name, "{mode}").is_ok() && name == text
    };
    let named = || (1..=10).filter_map(Mode::from_code).find(is);
    text.parse().ok().and_then(Mode::from_code).or_else(named)
}

/// Where the axis is to go, where it is under way to a position.
pub fn target(view: &View) -> Option<i32> {
    match view.wish {
        Wish::Move(Motion::Servo(Moves::Position { target, .. } | Moves::Interpolate(target)), _) => {
            Some(target)
        }
        _ => None,
    }
}
