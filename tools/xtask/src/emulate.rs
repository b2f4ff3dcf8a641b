//! `cargo xtask emulate`: the firmware on an emulated board, with the simulated cell on its line.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use puente_emulator::{Emulator, QEMU, Setup, tie};

use crate::Outcome;
use crate::board::{Board, EMULATED, Program, emulated};
use crate::command::{Options, cargo, install_debian, program, root, run as run_command, target_dir, works};
use crate::cross::Cross;
use crate::firmware;

/// How a test file begins that has nothing to do on a board; the reason follows.
const HOST_ALONE: &str = "//! Host alone: ";

/// How long a new start may take.
const ANEW: Duration = Duration::from_secs(10);

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
    run_command(cargo().args(["build", "--package", "cell", "--bin", "cell", "--quiet"]))?;
    let cell = Cell::start(&mut Command::new(target_dir()?.join("debug/cell")), Door::Line)?;
    let setup = Setup { ports, ..Setup::new(image, cell.address) };
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
    let mut tests = cargo();
    let module = image_of(firmware::build, &emulated(Program::AxisModule))?;
    tests.args(["test", "--package", "puente", "--quiet", "--no-fail-fast"]);
    tests.env("PUENTE_IMAGE", image).env("PUENTE_MODULE_IMAGE", module);
    for name in scenarios().map_err(|error| format!("tests: {error}"))? {
        tests.args(["--test", &name]);
    }
    // Each test has a board of its own.
    run_command(tests.args(["--", "--test-threads=2"]))
}

/// The files and folders of tests/ that a board passes: all whose first line does not say that they are of the host alone.
fn scenarios() -> std::io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(root().join("tests"))? {
        let path = entry?.path();
        let file = if path.is_dir() { path.join("main.rs") } else { path.clone() };
        let is_test = file.extension().is_some_and(|extension| extension == "rs") && file.is_file();
        if is_test && !fs::read_to_string(&file)?.starts_with(HOST_ALONE) {
            names.extend(path.file_stem().map(|name| name.to_string_lossy().into_owned()));
        }
    }
    names.sort();
    Ok(names)
}

/// Builds the gateway's image, and makes sure of QEMU.
pub fn image(build: fn(&Cross, &Board) -> Result<PathBuf, String>) -> Result<PathBuf, String> {
    image_of(build, &EMULATED)
}

/// The same for a board of QEMU's that runs another program.
pub fn image_of(
    build: fn(&Cross, &Board) -> Result<PathBuf, String>,
    board: &Board,
) -> Result<PathBuf, String> {
    if !works(program(QEMU).arg("--version")) {
        install_debian(&[QEMU])?;
    }
    build(&Cross::find()?, board)
}

/// How a client comes to a simulated cell.
#[derive(Clone, Copy)]
pub enum Door {
    /// Raw bytes of its line.
    Line,
    /// An SLCAN adapter on its CAN bus.
    Slcan,
}

/// The simulated cell on a TCP port; it ends with this value.
pub struct Cell {
    child: Child,
    /// Where its door is.
    pub address: SocketAddr,
}

impl Cell {
    pub fn start(program: &mut Command, door: Door) -> Result<Self, String> {
        let option = match door {
            Door::Line => "--listen",
            Door::Slcan => "--slcan",
        };
        program.args([option, "127.0.0.1:0"]).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = tie(program).spawn().map_err(|error| format!("the cell: {error}"))?;
        let mut ready = String::new();
        if let Some(stdout) = child.stdout.take() {
            BufReader::new(stdout).read_line(&mut ready).map_err(|error| format!("the cell: {error}"))?;
        }
        let address =
            ready.strip_prefix("ready ").and_then(|name| name.split_whitespace().last()?.parse().ok());
        Ok(Self { child, address: address.ok_or(format!("the cell says '{ready}'"))? })
    }
}

impl Drop for Cell {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Gives the board other settings, and waits until it has started with them: until they say `word`.
pub fn configure(board: SocketAddr, settings: &str, word: &str) -> Outcome {
    let head =
        format!("PUT /api/config HTTP/1.1\r\nHost: board\r\nContent-Length: {}\r\n\r\n", settings.len());
    let put = ask(board, &(head + settings))?;
    if !put.starts_with("HTTP/1.1 200") {
        return Err(format!("PUT /api/config: {put}"));
    }
    let deadline = Instant::now() + ANEW;
    while Instant::now() < deadline {
        thread::sleep(Duration::from_millis(50));
        let get = ask(board, "GET /api/config HTTP/1.1\r\nHost: board\r\n\r\n");
        if get.is_ok_and(|reply| reply.contains(word)) {
            return Ok(());
        }
    }
    Err("the board does not start with other settings".into())
}

/// What the board says to a request, as far as it comes with the first segment.
fn ask(board: SocketAddr, request: &str) -> Result<String, String> {
    let ask = || {
        let mut stream = TcpStream::connect(board)?;
        stream.set_read_timeout(Some(ANEW))?;
        stream.write_all(request.as_bytes())?;
        let mut reply = [0; 2048];
        let length = stream.read(&mut reply)?;
        Ok(String::from_utf8_lossy(&reply[..length]).into_owned())
    };
    ask().map_err(|error: std::io::Error| format!("{board}: {error}"))
}
