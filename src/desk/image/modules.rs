//! What the wishes mean to PID modules.

use puente_drives::pid::{Event, Gains, State};
use puente_modules::master::{Output, Statistics};
use puente_modules::{Control, MAX_SET_POINT, Report};

use super::{BusImage, Feedback, Kind, Motion, View, Wish};
use crate::bus::Cycles;
use crate::desk::Cause;

/// PID modules on a framed bus.
pub struct Modules;

impl Kind for Modules {
    type Output = Output;
    type Report = Report;
    type Fall = Control;

    /// A module enables itself with gains only, so that a stop says none.
    fn output(view: &View) -> Output {
        let here = view.module().map_or(0, |(_, report)| report.position);
        let here = here.clamp(-MAX_SET_POINT, MAX_SET_POINT);
        let (control, gains, set_point) = match view.wish {
            Wish::Observe => (Control::Observe, view.gains, here),
            Wish::Off | Wish::Clear(_) => (Control::Off, view.gains, here),
            Wish::Stop => (Control::Hold, Gains::default(), here),
            // What a servo may do is nothing to a module.
            Wish::Hold | Wish::Move(Motion::Servo(_), _) => (Control::Hold, view.gains, here),
            Wish::Move(Motion::Follow(set_point), _) => (Control::Follow, view.gains, set_point),
        };
        Output { control, gains, set_point }
    }

    fn feedback(report: Report) -> Feedback {
        Feedback::Module(report)
    }

    fn fallen(wish: Wish, to: Control) -> Option<Wish> {
        match (wish, to) {
            (Wish::Move(..), Control::Hold) => Some(Wish::Hold),
            (Wish::Move(..) | Wish::Hold, Control::Observe) => Some(Wish::Observe),
            // It is not wanted any more in any case.
            _ => None,
        }
    }

    fn cause(view: &View, _: Control) -> Cause {
        match view.module() {
            Some((_, Report { state: State::Fault(_), .. })) => Cause::DriveFault,
            _ => Cause::Stopped,
        }
    }
}

/// What is wanted of a module after a `wish` which this report answers.
pub(super) fn ends(report: &Report, wish: Wish) -> Option<Wish> {
    let done = match wish {
        Wish::Off | Wish::Clear(_) => report.state == State::Disabled,
        Wish::Stop => at_rest(report.state),
        _ => false,
    };
    done.then_some(Wish::Observe)
}

/// Whether a module in this state follows no set-point.
pub fn at_rest(state: State) -> bool {
    matches!(state, State::Disabled | State::Held | State::Fault(_))
}

impl Cycles for BusImage<'_, Modules> {
    fn happened(&self, place: usize, event: Event) {
        if let (Some(axis), Event::Fault(cause)) = (self.axis(place), event) {
            log::warn!("axis {} of the settings: {cause}", axis + 1);
        }
    }

    fn counted(&self, statistics: Statistics) {
        self.on_bus(|bus| bus.cycles = statistics);
    }
}
