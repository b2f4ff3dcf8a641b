//! The two programs under measurement: the gateway, and the simulated cell on a pseudo terminal.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// A program that has said that it is ready; it is ended with this value.
struct Running(Child);

impl Running {
    /// Starts a program and returns what follows `ready ` in its first line.
    fn start(command: &mut Command) -> Result<(Self, String), String> {
        let name = command.get_program().to_string_lossy().into_owned();
        let child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut running = Self(child.map_err(|error| format!("{name}: {error}"))?);
        let mut line = String::new();
        if let Some(stdout) = running.0.stdout.take() {
            BufReader::new(stdout).read_line(&mut line).map_err(|error| format!("{name}: {error}"))?;
        }
        let ready = line.trim_end().strip_prefix("ready ").ok_or(format!("{name} did not get ready"))?;
        Ok((running, ready.to_owned()))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Where the programs and their files are.
pub struct Bench {
    /// Of the built programs.
    pub programs: PathBuf,
    /// For links, logs and settings.
    pub scratch: PathBuf,
}

/// The cell: one drive, unit 1, on a pseudo terminal at 115200 8E1.
pub struct Cell {
    _running: Running,
    /// The pseudo terminal.
    pub line: PathBuf,
    log: PathBuf,
}

impl Cell {
    pub fn start(bench: &Bench, paced: bool) -> Result<Self, String> {
        let (line, log) = (bench.scratch.join("line"), bench.scratch.join("cell.log"));
        let mut command = Command::new(bench.programs.join("cell"));
        command.args(["--protocol", "modbus-rtu", "--baud", "115200", "--format", "8E1", "--units", "1"]);
        command.args(["--reply-delay-ms", "0", "--max-read", "125"]);
        if !paced {
            command.arg("--unpaced");
        }
        command.arg("--pty").arg(&line).arg("--log").arg(&log);
        let (running, _) = Running::start(&mut command)?;
        Ok(Self { _running: running, line, log })
    }

    /// The moments at which the replies of this many bytes were complete on the line, since the cell's start.
    pub fn replies(&self, bytes: usize) -> Result<Vec<Duration>, String> {
        let log = fs::read_to_string(&self.log).map_err(|error| format!("the cell's log: {error}"))?;
        let reply = |line: &str| {
            let (micros, frame) = line.split_once(" < ")?;
            (frame.len() == 2 * bytes).then(|| micros.parse().ok().map(Duration::from_micros))?
        };
        Ok(log.lines().filter_map(reply).collect())
    }
}

/// A cell of drives on a CAN bus of 1 Mbit/s, behind an SLCAN adapter on TCP.
pub struct CanCell {
    _running: Running,
    /// The adapter.
    pub address: SocketAddr,
}

impl CanCell {
    /// With Lexium 23A of these node-IDs.
    pub fn start(bench: &Bench, nodes: &[u8]) -> Result<Self, String> {
        let mut command = Command::new(bench.programs.join("cell"));
        command.args(["canopen", "--bitrate", "1000000", "--slcan", "127.0.0.1:0"]);
        for node in nodes {
            command.arg("--drive").arg(format!("{node}=lexium23a"));
        }
        let (running, ready) = Running::start(&mut command)?;
        let address = ready.strip_prefix("slcan ").and_then(|address| address.parse().ok());
        let address = address.ok_or_else(|| format!("the cell names no adapter: {ready}"))?;
        Ok(Self { _running: running, address })
    }
}

/// The gateway with one bus.
pub struct Gateway {
    _running: Running,
    /// Its port for all dialects.
    pub main: SocketAddr,
    /// Its port for Modbus/TCP.
    pub address: SocketAddr,
}

impl Gateway {
    /// With an RTU bus at 115200 8E1.
    pub fn start(bench: &Bench, line: &Path) -> Result<Self, String> {
        let (name, line) = ("modbus-rtu", line.display());
        let bus = format!(
            "[[bus]]\nname = \"a\"\nprotocol = \"{name}\"\nport = \"{line}\"\nbaud = 115200\nformat = \"8E1\"\n"
        );
        Self::with(bench, &bus)
    }

    /// With this bus.
    pub fn with(bench: &Bench, bus: &str) -> Result<Self, String> {
        let settings = bench.scratch.join("gateway.toml");
        let text = format!("[net]\nport = 0\nmodbus_port = 0\nclients = 40\n{bus}");
        fs::write(&settings, text).map_err(|error| format!("{}: {error}", settings.display()))?;
        let mut command = Command::new(bench.programs.join("gateway"));
        let (running, ready) = Running::start(command.arg("--config").arg(&settings))?;
        let named = |door: &str| {
            let (_, address) = ready.split_once(door)?;
            address.split_whitespace().next()?.parse().ok()
        };
        let missing = || format!("the gateway names no such port: {ready}");
        let main = named("http://").ok_or_else(missing)?;
        let address = named("modbus-tcp://").ok_or_else(missing)?;
        Ok(Self { _running: running, main, address })
    }
}
