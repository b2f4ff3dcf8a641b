//! Group start: several drives go through the same stages, and none begins one before all have ended the last.
//!
//! One group at a time. Whoever started it commands all of its axes, and shows life meanwhile; when one fails, or its
//! commander is gone, all are stopped.

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::Timer;
use puente_drives::cia402::{Mode, State};
use puente_servos::{Node, Progress};

use super::{Axes, AxisError, Commander, Drive, cia402};
use crate::clock;
use crate::desk::{Failure, Motion, Reason, Wish};
use crate::port::limits::AXES;

/// The axes of a group are looked at so often.
const LOOK: embassy_time::Duration = embassy_time::Duration::from_millis(10);
const STOPPED: AxisError = AxisError::Failure(Failure::NotSent(Reason::Stopped));

// Each axis is a bit of a set.
const _: () = assert!(AXES <= 32);

/// Axes, by their numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Set(u32);

/// How far a group is to go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// Under current.
    Enabled,
    /// And at home: each searches for it.
    Homed,
    /// At home, where it is not known yet, and in a mode.
    In(Mode),
}

/// What the axes of a group are at. They go from one to the next together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Their nodes boot, and are in no fault.
    Booting,
    /// They go under current.
    Enabling,
    /// They search for home.
    Homing,
    /// They go to the mode.
    Mode(Mode),
    /// All have come to the goal.
    Done,
}

/// A group on its way, or the last one.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    /// Its axes.
    pub axes: Set,
    /// Who started it.
    pub by: Commander,
    /// How far it is to go.
    pub goal: Goal,
    /// How far it is.
    pub stage: Stage,
    /// Which axis has failed, and why. All have been stopped.
    pub failed: Option<(u8, AxisError)>,
}

/// Where the group is that is on its way.
pub(super) struct Group {
    run: Mutex<CriticalSectionRawMutex, Cell<Option<Run>>>,
    begun: Signal<CriticalSectionRawMutex, ()>,
}

impl Set {
    /// With an axis more.
    #[must_use]
    pub const fn with(self, id: u8) -> Self {
        Self(self.0 | 1_u32.wrapping_shl(id as u32))
    }

    /// Its axes.
    pub fn iter(self) -> impl Iterator<Item = u8> {
        (0..32).filter(move |id| self.0 & 1 << id != 0)
    }
}

impl Stage {
    /// Its name, as clients see it.
    pub const fn name(self) -> &'static str {
        match self {
            Stage::Booting => "booting",
            Stage::Enabling => "enabling",
            Stage::Homing => "homing",
            Stage::Mode(_) => "mode",
            Stage::Done => "done",
        }
    }
}

impl Run {
    /// Whether it is on its way.
    pub fn goes_on(&self) -> bool {
        self.failed.is_none() && self.stage != Stage::Done
    }
}

impl Group {
    pub(super) const fn new() -> Self {
        Self { run: Mutex::new(Cell::new(None)), begun: Signal::new() }
    }

    fn change(&self, f: impl FnOnce(&mut Run)) {
        self.run.lock(|cell| {
            cell.set(cell.get().map(|mut run| {
                f(&mut run);
                run
            }));
        });
    }
}

impl Axes {
    /// The group that is on its way, or the last one.
    pub fn group(&self) -> Option<Run> {
        self.group.run.lock(Cell::get)
    }

    /// The axes that hold a group up: they have not ended its stage.
    pub fn awaited(&self, run: &Run) -> impl Iterator<Item = u8> {
        let (axes, stage) = (run.axes, run.stage);
        axes.iter().filter(move |id| !matches!(self.has_ended(*id, stage), Ok(true)))
    }

    /// Starts a group. Its commander has the leases of all of its axes from now on.
    ///
    /// # Errors
    /// Where another group is on its way, an axis is no CiA 402 drive, or another commands it.
    pub fn start_group(&self, axes: Set, by: Commander, goal: Goal) -> Result<(), AxisError> {
        for id in axes.iter() {
            let Drive::Cia402(_) = self.get(id)?.drive else { return Err(AxisError::Unsupported(NO_GROUP)) };
        }
        if self.group().is_some_and(|run| run.goes_on()) {
            return Err(AxisError::Group);
        }
        for id in axes.iter() {
            let leased = self.desk.lease(clock::now(), id, by.holder, None);
            let permit = leased.inspect_err(|_| self.let_go(axes, by))?;
            self.desk.moving(clock::now(), permit);
        }
        let run = Run { axes, by, goal, stage: Stage::Booting, failed: None };
        self.group.run.lock(|cell| cell.set(Some(run)));
        self.group.begun.signal(());
        Ok(())
    }

    /// Stops all axes of a set at once, and waits until their drives have confirmed it. The first that has not is told.
    /// Allowed to everyone.
    pub async fn stop_group(&self, axes: Set, by: Commander, off: bool) -> Result<(), AxisError> {
        for id in axes.iter() {
            match off {
                true => self.desk.switch_off(clock::now(), id),
                false => self.desk.quick_stop(clock::now(), id),
            }
        }
        self.group.change(|run| {
            if run.goes_on() && run.axes.0 & axes.0 != 0 {
                run.failed = axes.iter().next().map(|id| (id, STOPPED));
            }
        });
        let mut result = Ok(());
        for id in axes.iter() {
            let stopped = match off {
                true => self.disable(id, by).await,
                false => self.stop(id, by).await,
            };
            result = result.and(stopped);
        }
        result
    }

    /// Takes groups through their stages, for ever.
    pub async fn work_groups(&self) -> ! {
        loop {
            self.group.begun.wait().await;
            let Some(run) = self.group() else { continue };
            if let Err((axis, error)) = self.stages(&run).await {
                self.group.change(|run| run.failed = run.failed.or(Some((axis, error))));
                log::warn!("group: axis {} of the settings: {error}; all are stopped", axis + 1);
                let _ = self.stop_group(run.axes, run.by, false).await;
            }
        }
    }

    async fn stages(&self, run: &Run) -> Result<(), (u8, AxisError)> {
        self.all(run, Stage::Booting).await?;
        self.stage(Stage::Enabling);
        for id in run.axes.iter() {
            self.enable(id, run.by).await.map_err(|error| (id, error))?;
        }
        self.all(run, Stage::Enabling).await?;
        if run.goal != Goal::Enabled {
            self.stage(Stage::Homing);
            for id in run.axes.iter().filter(|id| run.goal == Goal::Homed || !self.is_homed(*id)) {
                self.home(id, run.by, None, None, false).await.map_err(|error| (id, error))?;
            }
            self.all(run, Stage::Homing).await?;
        }
        if let Goal::In(mode) = run.goal {
            self.stage(Stage::Mode(mode));
            for id in run.axes.iter() {
                self.mode(id, run.by, mode, None).await.map_err(|error| (id, error))?;
            }
            self.all(run, Stage::Mode(mode)).await?;
        }
        self.stage(Stage::Done);
        Ok(())
    }

    fn stage(&self, stage: Stage) {
        self.group.change(|run| run.stage = stage);
    }

    /// Waits until all have ended a stage; or one has failed, or the group has been stopped.
    async fn all(&self, run: &Run, stage: Stage) -> Result<(), (u8, AxisError)> {
        loop {
            if let Some(Some(failed)) = self.group().map(|run| run.failed) {
                return Err(failed);
            }
            let mut ended = true;
            for id in run.axes.iter() {
                ended &= self.has_ended(id, stage).map_err(|error| (id, error))?;
                if stage == Stage::Booting && self.desk.leased(clock::now(), id).is_none() {
                    return Err((id, STOPPED));
                }
            }
            if ended {
                return Ok(());
            }
            Timer::after(LOOK).await;
        }
    }

    /// Whether an axis has ended a stage, or why it will not.
    fn has_ended(&self, id: u8, stage: Stage) -> Result<bool, AxisError> {
        let view = self.desk.view(clock::now(), id);
        let Some((_, report)) = view.servo() else { return Ok(false) };
        if let (Stage::Booting, Node::Absent | Node::Booting | Node::Lost) = (stage, report.node) {
            return Ok(false);
        }
        if report.node != Node::Present {
            return Err(AxisError::Node(report.node));
        }
        if cia402::faulty(&report) {
            return Err(cia402::fault(&report));
        }
        if let Progress::Failed(failure) = report.progress {
            return Err(AxisError::Drive(failure, report.state()));
        }
        let moves = matches!(view.wish, Wish::Move(Motion::Servo(_), _));
        match stage {
            Stage::Booting | Stage::Done => Ok(true),
            _ if report.state() != Some(State::OperationEnabled) => {
                // It has been under current, but for those that are yet to be.
                if stage == Stage::Enabling { Ok(false) } else { Err(STOPPED) }
            }
            Stage::Enabling => Ok(true),
            Stage::Homing => Ok(report.homed && !moves),
            Stage::Mode(mode) => Ok(report.mode == Some(mode)),
        }
    }

    fn is_homed(&self, id: u8) -> bool {
        self.desk.view(clock::now(), id).servo().is_some_and(|(_, report)| report.homed)
    }

    /// Gives back what was leased for a group that is not started.
    fn let_go(&self, axes: Set, by: Commander) {
        for id in axes.iter() {
            if self.desk.leased(clock::now(), id).is_some_and(|(holder, _)| holder == by.holder)
                && let Ok(permit) = self.desk.permit(clock::now(), id, by.holder)
            {
                self.desk.release(permit);
            }
        }
    }
}

const NO_GROUP: &str = "a group is of CiA 402 drives";
