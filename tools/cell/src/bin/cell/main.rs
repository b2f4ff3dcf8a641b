//! A simulated line or CAN bus on pseudo terminals, TCP ports or a serial device.

mod canopen;
mod framed;
mod input;
mod modbus;
mod options;

use std::process::ExitCode;

use options::Options;

fn main() -> ExitCode {
    let ran = match Options::parse(lexopt::Parser::from_env()) {
        Ok(Options::Help) => {
            print!("{}", options::help::text());
            return ExitCode::SUCCESS;
        }
        Ok(Options::Modbus(options)) => modbus::run(options),
        Ok(Options::Framed(options)) => framed::run(options),
        Ok(Options::Canopen(options)) => canopen::run(options),
        Err(error) => {
            eprintln!("cell: {error}; see cell --help");
            return ExitCode::from(2);
        }
    };
    match ran {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("cell: {error}");
            ExitCode::FAILURE
        }
    }
}
