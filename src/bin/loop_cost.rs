//! Takes the loop of a PID interface module through all its states, with each kind of encoder: `cargo xtask cost` counts
//! the instructions of every step. It has no other use.
#![no_std]
#![no_main]

use core::hint::black_box;
use core::time::Duration;

use embassy_executor::Spawner;
use puente::clock;
use puente::module::control::{Control, Servo};
use puente::module::setup;
use puente::port::mps2::span::{span_begins, span_ends, span_next};
use puente::port::{self, Axis, AxisBoard, CommandForm, Feedback};
use puente_drives::pid::{Cause, Command, Config, Gains, State, Status, Width, ssi};
use puente_line::Instant;
use puente_modules::node::Loop;

/// Steps in each state.
const STEPS: u32 = 2_000;
const PERIOD: Duration = Duration::from_micros(100);

#[cortex_m_rt::entry]
fn main() -> ! {
    port::run(start)
}

fn start(spawner: Spawner) {
    const W16: Width = Width::W16;
    const W25: Width = Width::new(25).expect("a width");
    AxisBoard::start(spawner, setup::BUS, Feedback::Quadrature, CommandForm::Voltage);
    let ssi = |parity| Feedback::Ssi { format: ssi::Format { width: W25, parity }, gray: true };
    for (name, feedback) in [
        ("quadrature", Feedback::Quadrature),
        ("Gray code, 16 bits parallel", Feedback::Parallel(W16)),
        ("SSI, 25 bits of Gray code", ssi(None)),
        ("SSI, 25 bits of Gray code and parity", ssi(Some(ssi::Parity::Even))),
    ] {
        Run::new(name, feedback).all();
    }
    log::info!("counted all");
}

/// A loop with everything on that its configuration offers.
fn config(feedback: Feedback) -> Config {
    Config {
        deadband: 1,
        slew: Some(1_000.0),
        speed: Some(1_000_000),
        following_error: 1_000_000,
        reversed: false,
        ..Config::new(feedback.encoder())
    }
}

struct Run {
    encoder: &'static str,
    control: Control<Axis>,
    now: Instant,
}

impl Run {
    fn new(encoder: &'static str, feedback: Feedback) -> Self {
        let servo = Servo::new(Axis::new(feedback), config(feedback)).expect("a configuration");
        Self { encoder, control: Control::new(servo), now: Instant::ZERO }
    }

    fn all(mut self) {
        self.steps("disabled", |_| None);
        assert_eq!(self.status().state, State::Disabled);
        self.command(Command::Gains(Gains::new(1e-4, 1e-5, 1e-6).expect("gains")));
        self.command(Command::Enable);
        self.now += PERIOD;
        // As long as the amplifier has to start; the last step closes the loop.
        self.count("starting", 201, |_| None);
        self.steps("following, at rest", |_| Some(Command::SetPoint(0)));
        self.steps("following, in motion", |step| Some(Command::SetPoint(i64::from(step) * 10)));
        assert!(self.status().position > 10_000);
        self.steps("following, at the limit of the command", |_| Some(Command::SetPoint(1_000_000)));
        assert!(self.status().command == 1.0);
        self.command(Command::Stop);
        self.steps("held", |_| Some(Command::SetPoint(0)));
        assert_eq!(self.status().state, State::Held);
        self.steps("falling into a fault, and in it", |_| None);
        assert_eq!(self.status().state, State::Fault(Cause::Communication));
    }

    fn status(&self) -> Status {
        (&self.control).status()
    }

    fn command(&self, command: Command) {
        (&self.control).command(self.now, command).expect("a command in its place");
    }

    fn steps(&mut self, state: &str, command: impl Fn(u32) -> Option<Command>) {
        self.count(state, STEPS, command);
    }

    /// Steps in one state, each after what the bus says, where it says something.
    fn count(&mut self, state: &str, steps: u32, command: impl Fn(u32) -> Option<Command>) {
        for step in 0..steps {
            if let Some(command) = command(step) {
                // A set-point that is refused is heard all the same.
                let _ = (&self.control).command(self.now, command);
            }
            cortex_m::interrupt::free(|_| {
                span_begins();
                black_box(clock::now());
                self.control.step(self.now);
                span_ends();
            });
            self.now += PERIOD;
        }
        log::info!("counted {}: {state}", self.encoder);
        span_next();
    }
}
