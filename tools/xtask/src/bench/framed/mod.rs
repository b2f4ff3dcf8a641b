//! The cycle of a gateway and its modules on a simulated line, against what the characters take.
//!
//! All times are virtual, so that every machine measures the same.

mod page;
mod rig;

use std::time::Duration;

use puente_framed::arbiter;
use puente_modules::Form;

use crate::Outcome;
use rig::{Figures, Gateway, Measured, measure, settings};

/// Time on the line of each row.
const TIME: Duration = Duration::from_secs(5);
/// What a cycle may take above its floor, in percent.
const MOST: f64 = 5.0;
/// Axes of the gateway whose cycle is measured.
const AXES: u8 = 3;
/// Characters of a report.
const REPORT: usize = 35;
const FORMS: [Form; 2] = [Form::Text, Form::Binary];
/// Cycles of two gateways on one line, ms; 0 for one after the other at once.
const SHARED: [(u64, u64); 4] = [(5, 5), (3, 4), (2, 2), (0, 0)];

/// A gateway with three axes that are asked in every cycle, as fast as it goes.
struct Fastest {
    form: Form,
    figures: Figures,
}

impl Fastest {
    fn measure(form: Form, time: Duration) -> Result<Self, String> {
        let gateway = Gateway { first: 17, axes: AXES, form, cycle: Duration::ZERO };
        let measured = measure(&[gateway], time)?;
        Ok(Self { form, figures: first(&measured)? })
    }

    /// What the characters of the frame and of the answers take.
    fn characters(&self) -> Result<Duration, String> {
        Ok(settings()?.wire_time(self.figures.update + usize::from(AXES) * REPORT))
    }

    /// The same with what the protocol demands before each: a gap before an answer, a gap and the deference before the frame.
    fn floor(&self) -> Result<Duration, String> {
        let manners = arbiter::Config::new(settings()?);
        Ok(self.characters()? + manners.gap * (1 + u32::from(AXES)) + manners.deference)
    }

    /// Percent above the floor.
    fn above(&self) -> Result<f64, String> {
        Ok((self.figures.mean.div_duration_f64(self.floor()?) - 1.0) * 100.0)
    }
}

/// A gateway with three axes and the cycle that is set unless another is.
fn default_cycle(form: Form, time: Duration) -> Result<Measured, String> {
    measure(&[Gateway { first: 17, axes: AXES, form, cycle: Duration::from_millis(2) }], time)
}

/// Two gateways, one with two axes and one with one.
fn shared((one, other): (u64, u64), time: Duration) -> Result<Measured, String> {
    let gateway =
        |first, axes, cycle| Gateway { first, axes, form: Form::Text, cycle: Duration::from_millis(cycle) };
    measure(&[gateway(17, 2, one), gateway(19, 1, other)], time)
}

fn first(measured: &Measured) -> Result<Figures, String> {
    measured.gateways.first().copied().ok_or_else(|| "nothing was measured".into())
}

pub fn run() -> Outcome {
    let fastest = FORMS.map(|form| Fastest::measure(form, TIME));
    let [text, binary] = fastest;
    let fastest = [text?, binary?];
    let [text, binary] = FORMS.map(|form| default_cycle(form, TIME));
    let default = [text?, binary?];
    let shared = SHARED.into_iter().map(|cycles| Ok((cycles, shared(cycles, TIME)?)));
    let shared = shared.collect::<Result<Vec<_>, String>>()?;
    println!("{}", page::page(&fastest, &default, &shared)?);
    for row in &fastest {
        let above = row.above()?;
        if above > MOST {
            return Err(format!("a cycle in {:?} takes {above:.1} % more than its floor", row.form));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Acceptance: at most 5 % above the floor.
    #[test]
    fn a_cycle_is_near_its_floor() {
        for form in FORMS {
            let row = Fastest::measure(form, Duration::from_millis(500)).expect("measured");
            assert!(row.above().expect("a floor") <= MOST, "{form:?}: {:?}", row.figures);
            assert!(row.above().expect("a floor") >= 0.0, "a floor that is none");
            assert_eq!((row.figures.collisions, row.figures.missed), (0, 0));
            assert!((row.figures.reports - f64::from(AXES)).abs() < 0.02, "all answer");
        }
    }

    /// Both begin at once, and neither ever pauses: once they have met, each lets the other go first.
    #[test]
    fn two_gateways_share_the_line() {
        let measured = shared((0, 0), Duration::from_millis(500)).expect("measured");
        let [one, other] = measured.gateways[..] else { panic!("two gateways") };
        assert!(one.cycles.abs_diff(other.cycles) < 10, "{one:?}, {other:?}");
        assert_eq!((one.missed, other.missed), (0, 0));
    }

    #[test]
    fn three_axes_in_text_fit_in_two_milliseconds() {
        let measured = default_cycle(Form::Text, Duration::from_millis(500)).expect("measured");
        let figures = first(&measured).expect("measured");
        assert_eq!((figures.overruns, figures.missed, figures.collisions), (0, 0, 0), "{figures:?}");
        assert_eq!(figures.mean, Duration::from_millis(2));
        assert!((0.6..0.8).contains(&measured.share), "{}", measured.share);
    }
}
