//! The PID module on a mock clock.

mod anything;
mod motion;
mod states;
mod supervision;

use std::time::Duration;

use puente_drives::pid::{
    Cause, Command, Config, Encoder, EncoderFault, Event, Gains, Input, Module, Output, Refused, State,
    Status, Width,
};
use puente_line::Instant;

/// A module, its clock and the lines that lead to it.
struct Rig {
    module: Module,
    now: Instant,
    period: Duration,
    encoder: Result<u32, EncoderFault>,
    amplifier_fault: bool,
}

/// 1 kHz, so that a step is a millisecond; no filter and no time to start, so that figures are simple.
fn config() -> Config {
    Config {
        rate: 1_000,
        filter: Duration::ZERO,
        start: Duration::ZERO,
        ..Config::new(Encoder::Binary(Width::W16))
    }
}

fn gains(kp: f32, ki: f32, kd: f32) -> Command {
    Command::Gains(Gains::new(kp, ki, kd).expect("gains"))
}

impl Rig {
    fn new(config: Config) -> Self {
        Self {
            module: Module::new(config).expect("config"),
            now: Instant::from_millis(5_000),
            period: Duration::from_secs(1) / config.rate,
            encoder: Ok(100),
            amplifier_fault: false,
        }
    }

    /// Enabled at position 100.
    fn enabled(config: Config) -> Self {
        let mut rig = Self::new(config);
        rig.step();
        rig.command(gains(0.001, 0.0, 0.0)).expect("gains");
        rig.command(Command::Enable).expect("enable");
        assert_eq!(rig.step().event, Some(Event::Enabled));
        rig
    }

    fn command(&mut self, command: Command) -> Result<(), Refused> {
        self.module.command(self.now, command)
    }

    fn step(&mut self) -> Output {
        self.now += self.period;
        let Self { encoder, amplifier_fault, now, .. } = *self;
        self.module.step(Input { encoder, amplifier_fault, now })
    }

    /// Steps with set-points coming.
    fn steps(&mut self, count: usize, target: i64) -> Output {
        for _ in 1..count {
            let _ = self.command(Command::SetPoint(target));
            self.step();
        }
        let _ = self.command(Command::SetPoint(target));
        self.step()
    }

    fn status(&self) -> Status {
        self.module.status()
    }

    fn state(&self) -> State {
        self.status().state
    }

    /// Asserts that this step leads to the fault, that nothing is driven from then on, and that it can be acknowledged.
    fn faults(&mut self, cause: Cause) {
        let off = Output { command: 0.0, enable: false, event: None };
        assert_eq!(self.step(), Output { event: Some(Event::Fault(cause)), ..off });
        assert_eq!(self.state(), State::Fault(cause));
        let refused = Err(Refused::State(State::Fault(cause)));
        assert_eq!(self.command(Command::Enable), refused);
        assert_eq!(self.command(Command::SetPoint(0)), refused);
        assert_eq!(self.command(Command::Stop), Ok(()));
        for _ in 0..1_000 {
            assert_eq!(self.step(), off);
        }
        assert_eq!(self.status().command, 0.0);
        assert_eq!(self.command(Command::Disable), Ok(()));
        assert_eq!(self.state(), State::Disabled);
        assert_eq!(self.step(), off);
    }
}
