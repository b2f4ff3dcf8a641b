//! What a machine builder sets, here and nowhere else. All modules of a machine may have the same image: the address is
//! a switch's.

use puente_drives::pid::Config;
use puente_line::{Format, Parity, Settings};
use puente_modules::Form;

use crate::port::{Bus, CommandForm, Feedback};

/// The encoder.
pub const FEEDBACK: Feedback = Feedback::Quadrature;

/// How the amplifier takes its command.
pub const COMMAND: CommandForm = CommandForm::Voltage;

/// The bus: all its stations alike.
pub const BUS: Bus = Bus {
    line: Settings { baud: 1_000_000, format: Format { data_bits: 8, parity: Parity::None, stop_bits: 1 } },
    gap: 2,
    slot: 8,
};

/// How the gateway writes what it wants; its key `payload`.
pub const FORM: Form = Form::Text;

/// The address where the switch is at 0; it adds 0 to 15.
pub const FIRST_ADDRESS: u8 = 16;

/// The loop and its supervision, 10 kHz but for what is said otherwise.
pub const fn config(feedback: Feedback) -> Config {
    Config { speed: Some(50_000), ..Config::new(feedback.encoder()) }
}
