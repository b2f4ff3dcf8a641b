//! The command to the amplifier.

use embassy_stm32::Peri;
use embassy_stm32::dac::{DacChannel, Value};
use embassy_stm32::gpio::{Level, Output, OutputType};
use embassy_stm32::mode::Blocking;
use embassy_stm32::peripherals::{DAC1, PA4, PA6, TIM3};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm, SimplePwmChannel};

/// Code of the converter for no command: half of 3.3 V,
const MIDDLE: f32 = 2048.0;
/// and so many codes from there to full scale.
const SCALE: f32 = 2047.0;
/// Above what can be heard, and low enough for the optocouplers of amplifiers.
const PWM: Hertz = Hertz(20_000);

/// Where it goes out.
pub(super) enum Command {
    Voltage(DacChannel<'static, Blocking>),
    Pwm { duty: SimplePwmChannel<'static, TIM3>, backwards: Output<'static>, most: f32 },
}

impl Command {
    /// A voltage of the converter: 0 to 3.3 V for -1 to 1.
    pub fn voltage(dac: Peri<'static, DAC1>, pin: Peri<'static, PA4>) -> Self {
        let mut dac = DacChannel::new_blocking(dac, pin);
        dac.set(Value::Bit12Right(MIDDLE as u16));
        Self::Voltage(dac)
    }

    /// A duty cycle, and `backwards` for a negative command.
    pub fn pwm(timer: Peri<'static, TIM3>, pin: Peri<'static, PA6>, backwards: Output<'static>) -> Self {
        let pin = PwmPin::new(pin, OutputType::PushPull);
        let pwm = SimplePwm::new(timer, Some(pin), None, None, None, PWM, Default::default());
        let mut duty = pwm.split().ch1;
        duty.set_duty_cycle_fully_off();
        duty.enable();
        let most = duty.max_duty_cycle() as f32;
        Self::Pwm { duty, backwards, most }
    }

    /// -1 to 1.
    pub fn set(&mut self, command: f32) {
        match self {
            Self::Voltage(dac) => dac.set(Value::Bit12Right((MIDDLE + 0.5 + SCALE * command) as u16)),
            Self::Pwm { duty, backwards, most } => {
                backwards.set_level(Level::from(command < 0.0));
                duty.set_duty_cycle((command.abs() * *most) as u32);
            }
        }
    }
}
