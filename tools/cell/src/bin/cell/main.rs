//! A simulated line on pseudo terminals, TCP ports or a serial device.

mod framed;
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
