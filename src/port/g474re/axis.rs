//! The axis: encoder, amplifier, and the watchdog over the loop.

use embassy_stm32::gpio::{Input, Level, Output};
use puente_drives::pid::EncoderFault;

use super::command::Command;
use super::encoder::Encoder;
use super::watchdog::Watchdog;
use crate::port::AxisIo;

/// Encoder and amplifier.
pub struct Axis {
    pub(super) encoder: Encoder,
    pub(super) command: Command,
    pub(super) enable: Output<'static>,
    /// Low where the amplifier is ready. A torn wire is a fault.
    pub(super) ready: Input<'static>,
    pub(super) watchdog: Watchdog,
}

impl AxisIo for Axis {
    fn sample(&mut self) -> Result<u32, EncoderFault> {
        self.encoder.sample()
    }

    fn amplifier_fault(&mut self) -> bool {
        self.ready.is_high()
    }

    fn apply(&mut self, command: f32, enable: bool) {
        self.command.set(command);
        self.enable.set_level(Level::from(enable));
    }

    fn feed(&mut self) {
        self.watchdog.feed();
    }
}
