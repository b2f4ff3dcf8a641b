//! Every build and check of puente: `cargo xtask COMMAND`.

mod bench;
mod board;
mod command;
mod cost;
mod cross;
mod docs;
mod emulate;
mod firmware;
mod fuzz;
mod peers;
mod size;
mod stack;
mod test;

use std::process::ExitCode;

/// What a command reports when it fails: one message for the user.
type Outcome = Result<(), String>;

struct Command {
    name: &'static str,
    usage: &'static str,
    does: &'static str,
    run: fn(&[String]) -> Outcome,
}

const COMMANDS: &[Command] = &[
    Command { name: "test", usage: "", does: "every check, as the CI runs them", run: test::run },
    Command {
        name: "firmware",
        usage: "[--board NAME|all]",
        does: "build the images to flash",
        run: firmware::run,
    },
    Command {
        name: "size",
        usage: "[--board NAME|all] [--top N] | --write",
        does: "flash and RAM of each board against budget and docs/boards.md, and the N largest statics",
        run: size::run,
    },
    Command {
        name: "stack",
        usage: "[--board NAME|all] [--top N]",
        does: "the N functions of the firmware that take most of the stack",
        run: stack::run,
    },
    Command {
        name: "emulate",
        usage: "[--port N] [--modbus-port N] | --test",
        does: "run the firmware on an emulated board with simulated drives, or the scenarios on it",
        run: emulate::run,
    },
    Command {
        name: "cost",
        usage: "[--write] [--loop] | --profile NAME",
        does: "instructions of each step of a module's loop, and of each transaction against docs/cost.md",
        run: cost::run,
    },
    Command { name: "fuzz", usage: "[--smoke] [TARGET]", does: "run the fuzz targets", run: fuzz::run },
    Command {
        name: "bench",
        usage: "modbus|csma",
        does: "measure transactions through the gateway, or CSMA/CD, against what the line allows",
        run: bench::run,
    },
    Command { name: "peers", usage: "", does: "exchange with independent Modbus programs", run: peers::run },
];

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or_default();
    let arguments: Vec<String> = arguments.collect();
    let Some(command) = COMMANDS.iter().find(|command| command.name == name) else {
        help();
        return if matches!(name.as_str(), "help" | "--help") {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        };
    };
    match (command.run)(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{name}: {message}");
            ExitCode::FAILURE
        }
    }
}

fn help() {
    eprintln!("cargo xtask COMMAND");
    for Command { name, usage, does, .. } in COMMANDS {
        eprintln!("  {:<38}{does}", format!("{name} {usage}"));
    }
}
