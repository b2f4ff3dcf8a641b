//! The loop of a module, and what the bus has to do with it.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use puente_drives::pid::{BadConfig, Command, Config, Event, Input, Module, Output, Refused, State, Status};
use puente_line::Instant;

use crate::port::AxisIo;

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

    /// What the bus wants.
    pub fn command(&mut self, now: Instant, command: Command) -> Result<(), Refused> {
        self.module.command(now, command)
    }

    /// How it stands.
    pub fn status(&self) -> Status {
        self.module.status()
    }
}

/// The loop, between the interrupt that steps it and the task that commands it. Each has it for itself, and not for long.
pub struct Control<A> {
    place: Mutex<CriticalSectionRawMutex, RefCell<Option<Servo<A>>>>,
    events: Channel<CriticalSectionRawMutex, Event, EVENTS>,
}

impl<A: AxisIo> Default for Control<A> {
    fn default() -> Self {
        Self::new()
    }
}

impl<A: AxisIo> Control<A> {
    /// A place for a loop.
    pub const fn new() -> Self {
        Self { place: Mutex::new(RefCell::new(None)), events: Channel::new() }
    }

    /// Puts the loop in.
    pub fn set(&self, servo: Servo<A>) {
        self.place.lock(|place| place.borrow_mut().replace(servo));
    }

    /// One step, at the time that is given. Of events that nobody fetches the first are kept.
    pub fn step(&self, now: Instant) {
        if let Some(Some(event)) = self.with(|servo| servo.step(now)) {
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

    /// How the loop stands; none before it is there.
    pub fn status(&self) -> Option<Status> {
        self.with(|servo| servo.status())
    }

    /// Carries out a command of the bus, or says why not; a refusal where there is no loop yet.
    pub fn command(&self, now: Instant, command: Command) -> Result<(), Refused> {
        self.with(|servo| servo.command(now, command)).unwrap_or(Err(Refused::State(State::Disabled)))
    }

    fn with<R>(&self, f: impl FnOnce(&mut Servo<A>) -> R) -> Option<R> {
        self.place.lock(|place| place.borrow_mut().as_mut().map(f))
    }
}
