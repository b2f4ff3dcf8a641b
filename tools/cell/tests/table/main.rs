//! The coordinate table: plants and modules together.

mod faults;
mod moves;
mod plant;
mod step_response;

use std::time::Duration;

use puente_cell::table::{Axis, AxisProfile};
use puente_drives::pid::{Command, Config, Encoder, Event, Gains, Status, Width};
use puente_line::Instant;

const MILLISECOND: Duration = Duration::from_millis(1);

/// An axis whose set-point comes every millisecond.
struct Rig {
    axis: Axis,
    now: Instant,
    events: Vec<(Instant, Event)>,
}

/// Takes any step of the set-point.
fn config() -> Config {
    Config { start: Duration::ZERO, following_error: u32::MAX, ..Config::new(Encoder::Binary(Width::W16)) }
}

/// No dry friction.
fn smooth() -> AxisProfile {
    let mut profile = AxisProfile::default();
    profile.motor.coulomb = 0.0;
    profile
}

impl Rig {
    /// Enabled at position 0.
    fn new(profile: &AxisProfile, config: Config, gains: [f32; 3]) -> Self {
        let axis = Axis::new(profile, config).expect("config");
        let mut rig = Self { axis, now: Instant::ZERO, events: Vec::new() };
        rig.pass();
        let [kp, ki, kd] = gains;
        rig.axis.command(Command::Gains(Gains::new(kp, ki, kd).expect("gains"))).expect("gains");
        rig.enable();
        rig
    }

    fn enable(&mut self) {
        self.axis.command(Command::Enable).expect("enable");
        self.pass();
    }

    /// One millisecond without a set-point.
    fn pass(&mut self) {
        self.now += MILLISECOND;
        self.axis.advance(self.now, |at, event| self.events.push((at, event)));
    }

    /// One millisecond with a set-point at its beginning.
    fn follow(&mut self, target: i64) {
        let _ = self.axis.command(Command::SetPoint(target));
        self.pass();
    }

    fn milliseconds(&mut self, count: usize, target: i64) {
        for _ in 0..count {
            self.follow(target);
        }
    }

    fn status(&self) -> Status {
        self.axis.module().status()
    }
}
