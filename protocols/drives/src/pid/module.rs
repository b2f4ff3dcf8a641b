//! The module: supervision around the loop.

use puente_line::Instant;

use super::control::{Control, Tuning};
use super::encoder::Tracker;
use super::reference::Reference;
use super::{BadConfig, Cause, Command, Config, EncoderFault, Event, Refused, State, Status};

/// What a module sees at one step.
#[derive(Clone, Copy, Debug)]
pub struct Input {
    /// A sample of the encoder, as [`Encoder`](super::Encoder) says; or why there is none.
    pub encoder: Result<u32, EncoderFault>,
    /// Whether the amplifier says that it is not ready.
    pub amplifier_fault: bool,
    /// The time.
    pub now: Instant,
}

/// What a module wants at one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// -1 to 1 for -10 V to +10 V; 0 whenever `enable` is false.
    pub command: f32,
    /// The amplifier's enable line.
    pub enable: bool,
    /// What happened, if anything.
    pub event: Option<Event>,
}

/// One axis: the loop, its supervision, its state.
///
/// Call [`Module::step`] at [`Config::rate`], and [`Module::command`] between steps.
///
/// A fault sets the command to 0 and disables the amplifier in the step that finds it, without slew. Faults are looked
/// for from the enable on; without current there are none, only refusals. Of several in one step the first counts, in
/// this order: encoder, amplifier, communication, following error.
#[derive(Clone, Debug)]
pub struct Module {
    tracker: Tracker,
    tuning: Tuning,
    limits: Limits,
    reversed: bool,
    /// When a set-point or an enable came last.
    heard: Instant,
    command: f32,
    gains_hold: bool,
    phase: Phase,
}

/// What the supervision compares with.
#[derive(Clone, Copy, Debug)]
struct Limits {
    /// 2^-32 counts a step.
    reference_step: u64,
    following_error: u32,
    /// Steps.
    following_steps: u32,
    /// Microseconds.
    communication: u64,
    /// Microseconds.
    start: u64,
}

#[derive(Clone, Copy, Debug)]
enum Phase {
    Disabled,
    Starting { since: Instant, held: bool },
    Active(Active),
    Fault(Cause),
}

/// An axis under control. A new one stands still where it is, with nothing integrated.
#[derive(Clone, Copy, Debug)]
struct Active {
    /// Stopped: it takes no set-points.
    held: bool,
    reference: Reference,
    control: Control,
    /// Steps for which the following error has been too great.
    outside: u32,
}

impl Module {
    /// A disabled module, its gains 0; [`BadConfig`] says which setting is out of its range.
    pub fn new(config: Config) -> Result<Self, BadConfig> {
        config.check()?;
        let micros = |duration: core::time::Duration| duration.as_micros().try_into().unwrap_or(u64::MAX);
        Ok(Self {
            tracker: config.tracker(),
            tuning: config.tuning(),
            limits: Limits {
                reference_step: config.reference_step(),
                following_error: config.following_error,
                following_steps: config.following_steps(),
                communication: micros(config.communication),
                start: micros(config.start),
            },
            reversed: config.reversed,
            heard: Instant::ZERO,
            command: 0.0,
            gains_hold: false,
            phase: Phase::Disabled,
        })
    }

    /// Carries out a command from the bus, or says why not.
    ///
    /// A set-point that is refused because the axis is starting or held still counts as communication.
    pub fn command(&mut self, now: Instant, command: Command) -> Result<(), Refused> {
        match command {
            Command::Gains(gains) => {
                if self.is_enabled() && !gains.hold() {
                    return Err(Refused::Gains);
                }
                self.tuning.set_gains(gains);
                self.gains_hold = gains.hold();
                Ok(())
            }
            Command::SetPoint(target) => self.set_point(now, target),
            Command::Enable => self.enable(now),
            Command::Disable => {
                self.phase = Phase::Disabled;
                self.command = 0.0;
                Ok(())
            }
            Command::Stop => {
                self.stop();
                Ok(())
            }
        }
    }

    fn set_point(&mut self, now: Instant, target: i64) -> Result<(), Refused> {
        self.heard = now;
        match &mut self.phase {
            Phase::Active(active) if !active.held => {
                active.reference.set_target(target);
                Ok(())
            }
            _ => Err(Refused::State(self.state())),
        }
    }

    fn enable(&mut self, now: Instant) -> Result<(), Refused> {
        match &mut self.phase {
            Phase::Fault(_) => return Err(Refused::State(self.state())),
            Phase::Starting { held, .. } => *held = false,
            Phase::Active(active) => active.held = false,
            Phase::Disabled => {
                self.tracker.health().map_err(Refused::Encoder)?;
                if !self.gains_hold {
                    return Err(Refused::Gains);
                }
                self.phase = Phase::Starting { since: now, held: false };
            }
        }
        self.heard = now;
        Ok(())
    }

    fn stop(&mut self) {
        match &mut self.phase {
            Phase::Starting { held, .. } => *held = true,
            Phase::Active(active) if !active.held => {
                active.held = true;
                active.reference = Reference::at(self.tracker.position());
            }
            _ => {}
        }
    }

    /// One step of the loop.
    pub fn step(&mut self, input: Input) -> Output {
        self.tracker.sample(input.encoder);
        let mut event = self.start(input.now);
        if let Some(cause) = self.supervise(&input) {
            self.phase = Phase::Fault(cause);
            event = Some(Event::Fault(cause));
        }
        self.command = match &mut self.phase {
            Phase::Active(active) => {
                let error = distance(active.reference.position(), self.tracker.position());
                let command = active.control.step(&self.tuning, error, self.tracker.velocity());
                if self.reversed { -command } else { command }
            }
            _ => 0.0,
        };
        Output { command: self.command, enable: self.is_enabled(), event }
    }

    /// Closes the loop once the amplifier has had its time.
    #[inline]
    fn start(&mut self, now: Instant) -> Option<Event> {
        let Phase::Starting { since, held } = self.phase else { return None };
        if elapsed(now, since) < self.limits.start {
            return None;
        }
        let reference = Reference::at(self.tracker.position());
        self.phase = Phase::Active(Active { held, reference, control: Control::default(), outside: 0 });
        Some(Event::Enabled)
    }

    /// Moves the reference on and looks for a fault.
    #[inline]
    fn supervise(&mut self, input: &Input) -> Option<Cause> {
        if !self.is_enabled() {
            return None;
        }
        if let Err(fault) = self.tracker.health() {
            return Some(Cause::Encoder(fault));
        }
        if input.amplifier_fault && matches!(self.phase, Phase::Active(_)) {
            return Some(Cause::Amplifier);
        }
        if elapsed(input.now, self.heard) > self.limits.communication {
            return Some(Cause::Communication);
        }
        let Phase::Active(active) = &mut self.phase else { return None };
        active.reference.step(self.limits.reference_step);
        let error = distance(active.reference.position(), self.tracker.position());
        if error.unsigned_abs() <= self.limits.following_error {
            active.outside = 0;
            return None;
        }
        active.outside += 1;
        (active.outside > self.limits.following_steps).then_some(Cause::FollowingError)
    }

    const fn is_enabled(&self) -> bool {
        matches!(self.phase, Phase::Starting { .. } | Phase::Active(_))
    }

    const fn state(&self) -> State {
        match &self.phase {
            Phase::Disabled => State::Disabled,
            Phase::Starting { .. } => State::Starting,
            Phase::Active(Active { held: false, .. }) => State::Enabled,
            Phase::Active(_) => State::Held,
            Phase::Fault(cause) => State::Fault(*cause),
        }
    }

    /// The module after its last step and the commands since.
    pub const fn status(&self) -> Status {
        let position = self.tracker.position();
        let reference = match &self.phase {
            Phase::Active(active) => active.reference,
            _ => Reference::at(position),
        };
        Status {
            state: self.state(),
            position,
            velocity: self.tracker.velocity(),
            set_point: reference.target(),
            reference: reference.position(),
            command: self.command,
        }
    }
}

/// Counts from `position` to `reference`, as far as an i32 tells.
#[inline]
fn distance(reference: i64, position: i64) -> i32 {
    let way = reference.saturating_sub(position);
    way.try_into().unwrap_or(if way < 0 { i32::MIN } else { i32::MAX })
}

/// Microseconds.
#[inline]
fn elapsed(now: Instant, since: Instant) -> u64 {
    now.as_micros().saturating_sub(since.as_micros())
}
