//! `cargo xtask emulate`: the firmware on an emulated board, with the simulated cell on its line.

use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use puente_emulator::{Emulator, QEMU, Setup, tie};

use crate::Outcome;
use crate::board::{Board, EMULATED};
use crate::command::{Options, cargo, install_debian, program, run as run_command, target_dir, works};
use crate::cross::Cross;
use crate::firmware;

/// The ports that the gateway has on a PC.
const PORTS: [u16; 2] = [8080, 8502];

pub fn run(arguments: &[String]) -> Outcome {
    let mut options = Options::new(arguments);
    if options.flag("--test") {
        options.end()?;
        return test();
    }
    let mut port = |name, default| match options.value(name)? {
        None => Ok(default),
        Some(text) => text.parse().map_err(|error| format!("{name} {text}: {error}")),
    };
    let ports = [port("--port", PORTS[0])?, port("--modbus-port", PORTS[1])?];
    options.end()?;
    let image = image(firmware::build)?;
    run_command(cargo().args(["build", "--package", "puente-cell", "--bin", "cell", "--quiet"]))?;
    let cell = Cell::start(Command::new(target_dir()?.join("debug/cell")))?;
    let setup = Setup { ports, ..Setup::new(image, cell.line) };
    let mut board = Emulator::start(&setup, |line| eprintln!("{line}"))?;
    println!("ready http://{} modbus-tcp://{}", board.main, board.modbus);
    match board.wait() {
        Ok(status) => Err(format!("the board has ended: {QEMU} with {status}")),
        Err(error) => Err(error.to_string()),
    }
}

/// The scenarios that the host's gateway passes in `cargo test`, on the emulated board, and those of a board alone.
pub fn test() -> Outcome {
    let image = image(firmware::build_for_tests)?;
    // Each test has a board of its own.
    let arguments = ["test", "--package", "puente", "--test", "targets", "--test", "board", "--quiet"];
    run_command(cargo().args(arguments).args(["--", "--test-threads=2"]).env("PUENTE_IMAGE", image))
}

/// Builds the image, and makes sure of QEMU.
fn image(build: fn(&Cross, &Board) -> Result<PathBuf, String>) -> Result<PathBuf, String> {
    if !works(program(QEMU).arg("--version")) {
        install_debian(&[QEMU])?;
    }
    build(&Cross::find()?, &EMULATED)
}

/// The simulated cell on a TCP port; it ends with this value.
struct Cell {
    child: Child,
    line: SocketAddr,
}

impl Cell {
    fn start(mut program: Command) -> Result<Self, String> {
        program.args(["--listen", "127.0.0.1:0"]).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = tie(&mut program).spawn().map_err(|error| format!("the cell: {error}"))?;
        let mut ready = String::new();
        if let Some(stdout) = child.stdout.take() {
            BufReader::new(stdout).read_line(&mut ready).map_err(|error| format!("the cell: {error}"))?;
        }
        let line = ready.trim_end().strip_prefix("ready tcp ").and_then(|line| line.parse().ok());
        Ok(Self { child, line: line.ok_or(format!("the cell says '{ready}'"))? })
    }
}

impl Drop for Cell {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
