//! The axis: QEMU has neither encoder nor amplifier, so a motor is computed instead, a step at each step of the loop.

use puente_drives::pid::{EncoderFault, Width, gray};

use super::registers::EMULATOR;
use super::watchdog::Watchdog;
use crate::port::{AxisIo, Feedback};

/// In the emulator's page: whether the amplifier has a fault, 1 where it has one.
const AMPLIFIER_FAULT: usize = 0x04;
/// Steps a second.
const RATE: f32 = 10_000.0;
/// Speed at full command, counts a second.
const TOP_SPEED: f32 = 200_000.0;
/// What a step adds to the speed of what is wanted: a time constant of 5 ms.
const WEIGHT: f32 = 1.0 / (0.005 * RATE);

/// A motor behind an amplifier that sets its speed; without current it runs down as fast as it is driven.
#[derive(Debug, Default)]
struct Motor {
    /// Counts a second.
    speed: f32,
    /// Counts, and what is more than a whole one.
    position: u32,
    part: f32,
}

impl Motor {
    fn step(&mut self, command: f32) {
        self.speed += (command * TOP_SPEED - self.speed) * WEIGHT;
        self.part += self.speed / RATE;
        let counts = self.part as i32;
        self.position = self.position.wrapping_add_signed(counts);
        self.part -= counts as f32;
    }
}

/// Encoder and amplifier.
pub struct Axis {
    feedback: Feedback,
    motor: Motor,
    watchdog: Watchdog,
}

impl Axis {
    /// A motor at rest at 0, whose encoder is as it is said.
    pub fn new(feedback: Feedback) -> Self {
        Self { feedback, motor: Motor::default(), watchdog: Watchdog::start() }
    }
}

impl AxisIo for Axis {
    fn sample(&mut self) -> Result<u32, EncoderFault> {
        let position = self.motor.position;
        let code = |width: Width, is_gray| {
            let number = position & width.max();
            if is_gray { gray::from_binary(number) } else { number }
        };
        match self.feedback {
            Feedback::Quadrature => Ok(position),
            Feedback::Parallel(width) => Ok(code(width, true)),
            Feedback::Ssi { format, gray } => format.decode(format.encode(code(format.width, gray))),
        }
    }

    /// As the emulator's page of memory says.
    fn amplifier_fault(&mut self) -> bool {
        EMULATOR.read(AMPLIFIER_FAULT) == 1
    }

    fn apply(&mut self, command: f32, enable: bool) {
        self.motor.step(if enable { command } else { 0.0 });
    }

    fn feed(&mut self) {
        self.watchdog.refresh();
    }
}
