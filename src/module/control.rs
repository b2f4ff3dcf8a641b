//! The loop of a module, and what the bus has to do with it.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use puente_drives::pid::{BadConfig, Command, Config, Event, Input, Module, Output, Refused, Status};
use puente_line::Instant;
use puente_modules::node::Loop;

use crate::clock;
use crate::port::{AxisIo, Step};

/// Events that wait for the bus.
const EVENTS: usize = 4;
/// Steps without a sign of life from the bus after which the watchdog is left to bite: some seconds.
const PATIENCE: u32 = 20_000;

/// The loop of one axis, with its encoder and its amplifier.
pub struct Servo<A> {
    axis: A,
    module: Module,
    /// Steps for which the bus task may go on without a sign of life.
    patience: u32,
}

impl<A: AxisIo> Servo<A> {
    /// A loop at rest, the amplifier off; [`BadConfig`] where a setting is out of its range.
    pub fn new(mut axis: A, config: Config) -> Result<Self, BadConfig> {
        axis.apply(0.0, false);
        Ok(Self { axis, module: Module::new(config)?, patience: PATIENCE })
    }

    /// One step. It is all that the interrupt does.
    #[inline]
    pub fn step(&mut self, now: Instant) -> Option<Event> {
        let encoder = self.axis.sample();
        let amplifier_fault = self.axis.amplifier_fault();
        let Output { command, enable, event } = self.module.step(Input { encoder, amplifier_fault, now });
        self.axis.apply(command, enable);
        self.patience = self.patience.saturating_sub(1);
        if self.patience > 0 {
            self.axis.feed();
        }
        event
    }
}

/// The loop, between the interrupt that steps it and the task that commands it. Each has it for itself, and not for long.
pub struct Control<A> {
    servo: Mutex<CriticalSectionRawMutex, RefCell<Servo<A>>>,
    events: Channel<CriticalSectionRawMutex, Event, EVENTS>,
}

impl<A: AxisIo> Control<A> {
    /// Both may have this loop.
    pub const fn new(servo: Servo<A>) -> Self {
        Self { servo: Mutex::new(RefCell::new(servo)), events: Channel::new() }
    }

    /// One step, at the time that is given. Of events that nobody fetches the first are kept.
    pub fn step(&self, now: Instant) {
        if let Some(event) = self.with(|servo| servo.step(now)) {
            let _ = self.events.try_send(event);
        }
    }

    /// What has happened; waits for it.
    pub async fn event(&self) -> Event {
        self.events.receive().await
    }

    /// To be called by the task again and again, lest the watchdog take it for dead.
    pub fn alive(&self) {
        self.with(|servo| servo.patience = PATIENCE);
    }

    fn with<R>(&self, f: impl FnOnce(&mut Servo<A>) -> R) -> R {
        self.servo.lock(|servo| f(&mut servo.borrow_mut()))
    }
}

impl<A: AxisIo + Send> Step for Control<A> {
    fn step(&self) {
        Control::step(self, clock::now());
    }
}

impl<A: AxisIo> Loop for &Control<A> {
    fn command(&mut self, now: Instant, command: Command) -> Result<(), Refused> {
        self.with(|servo| servo.module.command(now, command))
    }

    fn status(&self) -> Status {
        self.with(|servo| servo.module.status())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

    use puente_drives::pid::{Cause, Encoder, EncoderFault, Gains, State, Width};

    use super::*;

    /// An axis that stands where it is told, and notes what it is given.
    struct Bench<'a> {
        /// The encoder's, or none where its line is torn.
        position: &'a AtomicU32,
        applied: Vec<(f32, bool)>,
        fed: u32,
    }

    const TORN: u32 = u32::MAX;

    impl AxisIo for Bench<'_> {
        fn sample(&mut self) -> Result<u32, EncoderFault> {
            match self.position.load(Relaxed) {
                TORN => Err(EncoderFault::Line),
                position => Ok(position),
            }
        }

        fn amplifier_fault(&mut self) -> bool {
            false
        }

        fn apply(&mut self, command: f32, enable: bool) {
            self.applied.push((command, enable));
        }

        fn feed(&mut self) {
            self.fed += 1;
        }
    }

    struct Rig<'a> {
        control: Control<Bench<'a>>,
        now: Instant,
    }

    impl<'a> Rig<'a> {
        fn new(position: &'a AtomicU32) -> Self {
            let bench = Bench { position, applied: Vec::new(), fed: 0 };
            let servo = Servo::new(bench, Config::new(Encoder::Binary(Width::W16))).expect("a configuration");
            Self { control: Control::new(servo), now: Instant::ZERO }
        }

        fn steps(&mut self, count: u32) {
            for _ in 0..count {
                self.now += core::time::Duration::from_micros(100);
                self.control.step(self.now);
            }
        }

        fn command(&mut self, command: Command) {
            (&self.control).command(self.now, command).expect("a command in its place");
        }

        fn applied(&self) -> (f32, bool) {
            self.control.with(|servo| *servo.axis.applied.last().expect("a command"))
        }

        fn fed(&self) -> u32 {
            self.control.with(|servo| servo.axis.fed)
        }

        fn event(&self) -> Option<Event> {
            self.control.events.try_receive().ok()
        }
    }

    #[test]
    fn a_fault_takes_the_current_away_in_the_step_that_finds_it() {
        let position = AtomicU32::new(100);
        let mut rig = Rig::new(&position);
        assert_eq!(rig.applied(), (0.0, false), "before the first step");
        rig.steps(1);
        rig.command(Command::Gains(Gains::new(0.01, 0.0, 0.0).expect("gains")));
        rig.command(Command::Enable);
        rig.steps(201);
        assert_eq!((rig.applied(), rig.event()), ((0.0, true), Some(Event::Enabled)));
        rig.command(Command::SetPoint(120));
        rig.steps(1);
        assert_eq!(rig.applied(), (0.01 * 20.0, true));
        position.store(TORN, Relaxed);
        rig.steps(1);
        assert_eq!(rig.applied(), (0.0, false));
        let cause = Cause::Encoder(EncoderFault::Line);
        assert_eq!(rig.event(), Some(Event::Fault(cause)));
        assert_eq!((&rig.control).status().state, State::Fault(cause));
    }

    #[test]
    fn the_watchdog_is_fed_as_long_as_the_bus_lives() {
        let position = AtomicU32::new(0);
        let mut rig = Rig::new(&position);
        for _ in 0..3 {
            rig.steps(PATIENCE - 1);
            rig.control.alive();
        }
        assert_eq!(rig.fed(), 3 * (PATIENCE - 1));
        rig.steps(3 * PATIENCE);
        assert_eq!(rig.fed(), 4 * (PATIENCE - 1), "the loop alone is not enough");
    }
}
