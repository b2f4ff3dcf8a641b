//! What a machine builder sets, here and nowhere else. All modules of a machine may have the same image: the address is
//! a switch's.

use puente_drives::pid::Config;
use puente_line::{Format, Parity, Settings};

use crate::port::{CommandForm, Feedback};

/// The encoder.
pub const FEEDBACK: Feedback = Feedback::Quadrature;

/// How the amplifier takes its command.
pub const COMMAND: CommandForm = CommandForm::Voltage;

/// The bus.
pub const LINE: Settings =
    Settings { baud: 1_000_000, format: Format { data_bits: 8, parity: Parity::None, stop_bits: 1 } };

/// The address where the switch is at 0; it adds 0 to 15.
pub const FIRST_ADDRESS: u8 = 16;

/// The loop and its supervision.
pub const fn config(feedback: Feedback) -> Config {
    Config { ..Config::new(feedback.encoder()) }
}
