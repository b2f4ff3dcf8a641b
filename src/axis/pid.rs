//! The axis commands of a PID module: each changes what is wanted in the process image, and waits until the module
//! reports that it is so.

use puente_drives::pid::{Gains, State};
use puente_line::Duration;
use puente_modbus::Evidence;
use puente_modules::{Form, MAX_SET_POINT, Report, setting};

use super::AxisError;
use crate::clock;
use crate::desk::{Desk, Failure, Permit, Reason, View, Wish, at_rest};

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

const STOPPED: AxisError = AxisError::Failure(Failure::NotSent(Reason::Stopped));

impl Module<'_> {
    fn view(&self) -> View {
        self.desk.view(clock::now(), self.axis)
    }

    /// Why a module that should have reported has not.
    fn silent(&self) -> AxisError {
        let failure = match self.desk.line_down(self.bus) {
            true => Failure::NotSent(Reason::LineDown),
            false => Failure::NoReply(Evidence::Silence),
        };
        AxisError::Failure(failure)
    }

    async fn until<T>(&self, within: Duration, f: impl FnMut(&View) -> Option<T>) -> Result<T, AxisError> {
        self.desk.until(self.axis, within, f).await.ok_or_else(|| self.silent())
    }

    /// A report that is not older than reports may be.
    pub(super) async fn status(&self) -> Result<View, AxisError> {
        let within = self.spec.within;
        let fresh = |view: &View| view.fresh(clock::now(), within).map(|_| *view);
        match fresh(&self.view()) {
            Some(view) => Ok(view),
            None => self.until(within, fresh).await,
        }
    }

    /// Puts the amplifier under current, at standstill where the axis is. An axis that is under way stops.
    pub(super) async fn enable(&self, permit: Permit) -> Result<(), AxisError> {
        if !self.view().gains.hold() {
            return Err(AxisError::NoGains);
        }
        if !matches!(self.view().wish, Wish::Hold | Wish::Follow(..)) {
            // The module enables itself for one who has let go of it. So that is to be known first.
            let free = |view: &View| view.answer().filter(|_| view.wish == Wish::Observe);
            if let State::Fault(cause) = self.until(self.spec.within, free).await?.state {
                return Err(AxisError::Fault(cause));
            }
        }
        if !self.desk.hold(clock::now(), permit) {
            return Err(STOPPED);
        }
        let held = self.until(self.spec.within + START, |view| {
            let report = view.answer();
            match (view.wish, report?.state) {
                (Wish::Hold, State::Held) => Some(Ok(())),
                (_, State::Fault(cause)) => Some(Err(AxisError::Fault(cause))),
                (Wish::Hold, _) => report?.refused.map(|refusal| Err(AxisError::Refused(refusal))),
                _ => Some(Err(STOPPED)),
            }
        });
        let result = held.await.flatten();
        if result.is_err() {
            // It must not come on later. If it has come on, unheard, it goes off by its own supervision.
            self.desk.give_up(clock::now(), self.axis);
        }
        result
    }

    /// Takes the current away, which acknowledges a fault.
    pub(super) async fn off(&self) -> Result<(), AxisError> {
        let off = |view: &View| (view.wish != Wish::Off).then_some(());
        self.until(self.spec.within, off).await
    }

    pub(super) async fn disable(&self) -> Result<(), AxisError> {
        self.desk.switch_off(clock::now(), self.axis);
        self.off().await
    }

    /// As [`disable`](Self::disable), under a permit.
    pub(super) async fn clear(&self, permit: Permit) -> Result<(), AxisError> {
        if !self.desk.release_current(clock::now(), permit) {
            return Err(STOPPED);
        }
        self.off().await
    }

    /// Brings the axis to rest; it stays under current.
    pub(super) async fn stop(&self) -> Result<(), AxisError> {
        let before = self.view();
        let rests = |report: Report| at_rest(report.state);
        if before.wish == Wish::Observe && before.fresh(clock::now(), self.spec.within).is_some_and(rests) {
            return Ok(());
        }
        self.desk.stop_cyclic(clock::now(), self.axis);
        let stopped = |view: &View| view.answer().is_some_and(rests).then_some(());
        self.until(self.spec.within, stopped).await
    }

    /// Goes to a position, under the lease of this permit; one that is under way changes its aim at once.
    pub(super) async fn follow(&self, permit: Permit, position: i32) -> Result<(), AxisError> {
        let under_way = matches!(self.view().wish, Wish::Follow(..));
        if !under_way && self.view().wish != Wish::Hold {
            self.desk.unlease(permit);
            return Err(AxisError::NotEnabled);
        }
        if !self.desk.follow(clock::now(), permit, position) {
            return Err(STOPPED);
        }
        if under_way {
            return Ok(());
        }
        let following = self.until(self.spec.within, |view| {
            let report = view.answer();
            match (view.wish, report?.state) {
                (Wish::Follow(..), State::Enabled) => Some(Ok(())),
                (_, State::Fault(cause)) => Some(Err(AxisError::Fault(cause))),
                (Wish::Follow(..), _) => report?.refused.map(|refusal| Err(AxisError::Refused(refusal))),
                _ => Some(Err(STOPPED)),
            }
        });
        // Where nothing was heard the lease stays, so that its end stops the axis.
        let result = following.await.flatten();
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
        if !gains.hold() && matches!(self.view().wish, Wish::Hold | Wish::Follow(..)) {
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
    view.input.is_some_and(|input| fast(input.report.velocity))
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
        Wish::Follow(position, _) => Some(position),
        _ => view.input.map(|input| reference(&input.report)),
    }
}

/// The command of the loop, in thousandths of full scale.
pub fn permille(report: &Report) -> i16 {
    let steps = report.command * 1000.0;
    (if steps < 0.0 { steps - 0.5 } else { steps + 0.5 }) as i16
}
