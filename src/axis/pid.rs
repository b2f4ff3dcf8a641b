//! The axis commands of a PID module: each changes what is wanted in the process image, and waits until the module
//! reports that it is so.

use puente_drives::pid::{Gains, State};
use puente_line::Duration;
use puente_modbus::Evidence;
use puente_modules::{Form, MAX_SET_POINT, Report, setting};

use super::AxisError;
use crate::clock;
use crate::desk::{Desk, Failure, Feedback, Motion, Permit, Reason, View, Wish, at_rest};

/// What a module may take for what needs its amplifier, beyond the time of a report.
const START: Duration = Duration::from_secs(1);
/// Speed of an axis at rest, at most, in counts/s: what is measured of one that holds its position may flicker.
const STANDSTILL: f32 = 50.0;

/// What the configuration says of a module.
#[derive(Clone, Copy, Debug)]
pub struct Spec {
    /// How numbers are written to it.
    pub form: Form,
    /// Reports come at shorter intervals than this, or the module is silent.
    pub within: Duration,
}

/// A module in the process image.
pub(super) struct Module<'a> {
    pub(super) desk: &'a Desk,
    pub(super) axis: u8,
    pub(super) bus: u8,
    pub(super) spec: Spec,
}

/// A stop, or the end of the lease, came first.
pub(super) const STOPPED: AxisError = AxisError::Failure(Failure::NotSent(Reason::Stopped));

/// What a command waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Awaited {
    /// A report, however it came about.
    Report,
    /// The module has heard that nothing is wanted of it, and is in no fault.
    LetGo,
    /// Under current, at rest.
    Held,
    /// Going to the set-point.
    Following,
    /// At rest.
    Rest,
    /// Without current.
    Off,
}

impl Awaited {
    /// Whether it has come about, or why it will not.
    fn found(self, view: &View, within: Duration) -> Option<Result<(), AxisError>> {
        let fresh = view.fresh(clock::now(), within);
        let answer = view.answer().and(fresh).and_then(Feedback::module);
        let state = answer.map(|report| report.state);
        let done = match self {
            Awaited::Report => fresh.is_some(),
            Awaited::LetGo => view.wish == Wish::Observe && state.is_some(),
            Awaited::Held => view.wish == Wish::Hold && state == Some(State::Held),
            Awaited::Following => matches!(view.wish, Wish::Move(..)) && state == Some(State::Enabled),
            Awaited::Rest => state.is_some_and(at_rest),
            Awaited::Off => view.wish != Wish::Off,
        };
        let (commanded, fault) = match self {
            Awaited::Held => (Some(view.wish == Wish::Hold), true),
            Awaited::Following => (Some(matches!(view.wish, Wish::Move(..))), true),
            // An Off that is still said acknowledges it.
            Awaited::LetGo => (None, view.wish == Wish::Observe),
            Awaited::Report | Awaited::Rest | Awaited::Off => (None, false),
        };
        let refused = answer.and_then(|report| report.refused);
        match (state, commanded, refused) {
            (Some(State::Fault(cause)), ..) if fault => Some(Err(AxisError::Fault(cause))),
            (_, Some(false), _) => Some(Err(STOPPED)),
            _ if done => Some(Ok(())),
            (_, Some(true), Some(refusal)) => Some(Err(AxisError::Refused(refusal))),
            _ => None,
        }
    }
}

impl Module<'_> {
    fn view(&self) -> View {
        self.desk.view(clock::now(), self.axis)
    }

    /// Waits for one of these, no longer than it may take.
    async fn confirm(&self, awaited: Awaited) -> Result<(), AxisError> {
        let start = if awaited == Awaited::Held { START } else { Duration::ZERO };
        let within = self.spec.within;
        // The answer comes after the report that may be on its way.
        let most = within.saturating_mul(2) + start;
        let found = self.desk.until(self.axis, most, |view| awaited.found(view, within)).await;
        found.unwrap_or_else(|| Err(self.silent()))
    }

    /// Why a module that should have reported has not.
    fn silent(&self) -> AxisError {
        let refused = self.desk.cycles(self.bus).and_then(|cycles| cycles.failure);
        let failure = match refused {
            _ if self.desk.line_down(self.bus) => Failure::NotSent(Reason::LineDown),
            Some(failure) => Failure::NotSent(Reason::Line(failure)),
            None => Failure::NoReply(Evidence::Silence),
        };
        AxisError::Failure(failure)
    }

    /// A report that is not older than reports may be.
    pub(super) async fn status(&self) -> Result<View, AxisError> {
        self.confirm(Awaited::Report).await?;
        Ok(self.view())
    }

    /// Puts the amplifier under current, at standstill where the axis is. An axis that is under way stops.
    pub(super) async fn enable(&self, permit: Permit) -> Result<(), AxisError> {
        if !self.view().gains.hold() {
            return Err(AxisError::NoGains);
        }
        if !matches!(self.view().wish, Wish::Hold | Wish::Move(..)) {
            // The module enables itself for one who has let go of it. So that is to be known first.
            self.confirm(Awaited::LetGo).await?;
        }
        if !self.desk.hold(clock::now(), permit) {
            return Err(STOPPED);
        }
        let result = self.confirm(Awaited::Held).await;
        if result.is_err() {
            // It must not come on later. If it has come on, unheard, it goes off by its own supervision.
            self.desk.give_up(clock::now(), self.axis);
        }
        result
    }

    /// Takes the current away, which acknowledges a fault: under a permit, where there is one.
    pub(super) async fn off(&self, permit: Option<Permit>) -> Result<(), AxisError> {
        match permit {
            None => self.desk.switch_off(clock::now(), self.axis),
            Some(permit) if self.desk.release_current(clock::now(), permit) => {}
            Some(_) => return Err(STOPPED),
        }
        self.confirm(Awaited::Off).await
    }

    /// Brings the axis to rest; it stays under current.
    pub(super) async fn stop(&self) -> Result<(), AxisError> {
        let before = self.view();
        let report = before.fresh(clock::now(), self.spec.within);
        if before.wish == Wish::Observe
            && report.and_then(Feedback::module).is_some_and(|report| at_rest(report.state))
        {
            return Ok(());
        }
        self.desk.stop_cyclic(clock::now(), self.axis);
        self.confirm(Awaited::Rest).await
    }

    /// Goes to a position, under the lease of this permit; one that is under way changes its aim at once.
    pub(super) async fn follow(&self, permit: Permit, position: i32) -> Result<(), AxisError> {
        let under_way = matches!(self.view().wish, Wish::Move(..));
        if !under_way && self.view().wish != Wish::Hold {
            self.desk.unlease(permit);
            return Err(AxisError::NotEnabled);
        }
        if !self.desk.go(clock::now(), permit, Motion::Follow(position)) {
            return Err(STOPPED);
        }
        if under_way {
            return Ok(());
        }
        // Where nothing is heard the lease stays, so that its end stops the axis.
        let result = self.confirm(Awaited::Following).await;
        if let Err(AxisError::Refused(_)) = result
            && self.desk.hold(clock::now(), permit)
        {
            self.desk.release(permit);
        }
        result
    }

    /// Gains, from now on.
    pub(super) fn set_gains(&self, permit: Permit, gains: Gains) -> Result<(), AxisError> {
        if setting::check(self.spec.form, gains).is_err() {
            return Err(AxisError::GainDigits);
        }
        if !gains.hold() && matches!(self.view().wish, Wish::Hold | Wish::Move(..)) {
            return Err(AxisError::NoGains);
        }
        if self.desk.set_gains(clock::now(), permit, gains) { Ok(()) } else { Err(STOPPED) }
    }
}

/// Bounds of a set-point.
pub(super) fn in_range(position: i32) -> Result<(), AxisError> {
    if (-MAX_SET_POINT..=MAX_SET_POINT).contains(&position) {
        return Ok(());
    }
    Err(AxisError::Range { value: position, min: -MAX_SET_POINT, max: MAX_SET_POINT })
}

/// Whether the axis turns.
pub(super) fn turns(view: &View) -> bool {
    let fast = |velocity: f32| !(-STANDSTILL..=STANDSTILL).contains(&velocity);
    view.module().is_some_and(|(_, report)| fast(report.velocity))
}

/// The name of a state, as clients see it.
pub const fn state(state: State) -> &'static str {
    match state {
        State::Disabled => "disabled",
        State::Starting => "starting",
        State::Enabled => "following",
        State::Held => "held",
        State::Fault(_) => "fault",
    }
}

/// Whether the amplifier is under current in this state, or about to be.
pub const fn enabled(state: State) -> bool {
    matches!(state, State::Starting | State::Enabled | State::Held)
}

/// Where the axis is to be now, in counts.
pub const fn reference(report: &Report) -> i32 {
    report.position.saturating_add(report.following_error as i32)
}

/// Where the axis is to go, in counts: the position that it was sent to, or where it is to stand.
pub fn set_point(view: &View) -> Option<i32> {
    match view.wish {
        Wish::Move(Motion::Follow(position), _) => Some(position),
        _ => view.module().map(|(_, report)| reference(&report)),
    }
}

/// The command of the loop, in thousandths of full scale.
pub fn permille(report: &Report) -> i16 {
    let steps = report.command * 1000.0;
    (if steps < 0.0 { steps - 0.5 } else { steps + 0.5 }) as i16
}
