//! A running gateway, a line with slaves on it, and small clients. Nothing here knows the gateway's code.
#![allow(dead_code, reason = "each test file uses a part of it")]

pub mod client;
pub mod rig;
pub mod wire;

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use puente_emulator::{Emulator, Setup};
use puente_line::Settings;
use puente_modbus::Mode;

/// Both framings of a serial line.
pub const MODES: [Mode; 2] = [Mode::Rtu, Mode::Ascii];

/// The line's baud rate and format in all tests that do not need another: fast, so that frames take little time.
pub fn fast() -> Settings {
    Settings { baud: 115_200, format: "8E1".parse().expect("a format") }
}

/// The line of the thesis.
pub fn thesis() -> Settings {
    Settings { baud: 9_600, format: "8O1".parse().expect("a format") }
}

pub fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A path of its own in the directory for tests.
pub fn scratch(name: &str) -> PathBuf {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}-{number}", std::process::id()))
}

/// A `[[bus]]` of the settings, with `more` keys.
pub fn bus(name: &str, mode: Mode, line: Settings, port: &str, more: &str) -> String {
    let protocol = match mode {
        Mode::Rtu => "modbus-rtu",
        Mode::Ascii => "modbus-ascii",
    };
    format!(
        "[[bus]]\nname = \"{name}\"\nprotocol = \"{protocol}\"\nport = \"{port}\"\nbaud = {}\nformat = \"{}\"\n{more}\n",
        line.baud, line.format
    )
}

/// An `[[axis]]` of the settings, on bus `a`.
pub fn axis(name: &str, address: u8) -> String {
    format!("[[axis]]\nname = \"{name}\"\nbus = \"a\"\ndrive = \"edb\"\naddress = {address}\n")
}

/// A running gateway; it ends with the test, which fails where the gateway has ended or failed before.
pub struct Gateway {
    process: Process,
    config: Option<PathBuf>,
    log: Arc<Mutex<String>>,
    fails: bool,
    /// The port of every dialect.
    pub main: SocketAddr,
    /// The port of Modbus/TCP alone.
    pub modbus: SocketAddr,
}

/// What the gateway runs in.
enum Process {
    Host(Child),
    Board(Emulator),
    /// The test itself has ended it.
    Ended,
}

impl Process {
    /// How it has ended by itself, where it has.
    fn ended(&mut self) -> Option<ExitStatus> {
        match self {
            Self::Host(child) => child.try_wait().expect("its state"),
            Self::Board(board) => board.ended(),
            Self::Ended => None,
        }
    }
}

impl Gateway {
    /// Starts the firmware on an emulated board, with bytes of its line at `line`.
    pub fn on_board(image: &Path, line: SocketAddr) -> Self {
        let log = Arc::new(Mutex::new(String::new()));
        let lines = log.clone();
        let keep = move |line: &str| {
            let mut log = lines.lock().expect("the log");
            log.push_str(line);
            log.push('\n');
        };
        let board = Emulator::start(&Setup::new(image, line), keep).unwrap_or_else(|error| {
            panic!("{error}; log:\n{}", log.lock().expect("the log"));
        });
        let (main, modbus) = (board.main, board.modbus);
        Self { process: Process::Board(board), config: None, log, fails: false, main, modbus }
    }

    /// Starts with these settings, on ports that the system chooses.
    pub fn start(settings: &str) -> Self {
        let config = scratch("settings.toml");
        fs::write(&config, settings).expect("a settings file");
        Self::run(Some(config))
    }

    /// Starts with nothing but free ports asked for.
    pub fn default() -> Self {
        Self::run(None)
    }

    fn run(config: Option<PathBuf>) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gateway"));
        if let Some(config) = &config {
            command.arg("--config").arg(config);
        }
        command.args(["--port", "0", "--modbus-port", "0"]).env("RUST_LOG", "info");
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        let log = Arc::new(Mutex::new(String::new()));
        let stderr = child.stderr.take().expect("its log");
        let lines = log.clone();
        thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                let mut log = lines.lock().expect("the log");
                log.push_str(&line);
                log.push('\n');
            }
        });
        let mut ready = String::new();
        BufReader::new(child.stdout.take().expect("its output")).read_line(&mut ready).expect("a line");
        let addresses = ready.trim_end().strip_prefix("ready http://").and_then(|rest| {
            let (main, modbus) = rest.split_once(" modbus-tcp://")?;
            Some((main.parse().ok()?, modbus.parse().ok()?))
        });
        let Some((main, modbus)) = addresses else {
            let _ = child.wait();
            thread::sleep(ms(50));
            panic!("'{ready}' is not the line `ready`; log:\n{}", log.lock().expect("the log"));
        };
        Self { process: Process::Host(child), config, log, fails: false, main, modbus }
    }

    /// Ends it by SIGTERM, as a service manager does.
    pub fn terminate(&mut self) -> ExitStatus {
        let Process::Host(mut child) = std::mem::replace(&mut self.process, Process::Ended) else {
            panic!("it runs on this machine");
        };
        let kill = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
        assert!(kill.expect("kill").success());
        child.wait().expect("its end")
    }

    /// Gives the emulator a command of its monitor.
    pub fn monitor(&mut self, command: &str) -> String {
        match &mut self.process {
            Process::Board(board) => board.monitor(command).expect("an answer"),
            Process::Host(_) | Process::Ended => panic!("there is no emulator"),
        }
    }

    /// It is going to fail, as this test wants it to.
    pub fn will_fail(&mut self) {
        self.fails = true;
    }

    /// What it has written to stderr.
    pub fn log(&self) -> String {
        self.log.lock().expect("the log").clone()
    }

    /// The most recent figure of `key` in the status of bus `a`.
    pub fn bus_figure(&self, key: &str) -> u64 {
        let status = client::Lines::connect(self.main).ask("bus a status");
        client::figure(&status, key)
    }
}

impl Drop for Gateway {
    fn drop(&mut self) {
        let ended = self.process.ended();
        if let Process::Host(child) = &mut self.process {
            let _ = child.kill();
            let _ = child.wait();
        }
        if let Some(config) = &self.config {
            let _ = fs::remove_file(config);
        }
        let log = self.log();
        if thread::panicking() {
            eprintln!("log of the gateway:\n{log}");
        } else {
            assert!(ended.is_none(), "the gateway has ended by itself: {ended:?}\n{log}");
            // A board that fails starts anew.
            let failed = ["panicked", "started after watchdog"].iter().any(|sign| log.contains(sign));
            assert_eq!(failed, self.fails, "{log}");
        }
    }
}

/// Runs the gateway for its options alone, which must end it.
pub fn run_to_end(arguments: &[&str]) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_gateway"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let deadline = Instant::now() + Duration::from_secs(20);
    while child.try_wait().expect("its state").is_none() {
        if Instant::now() > deadline {
            let _ = child.kill();
            let mut log = String::new();
            let _ = child.stderr.take().expect("its log").read_to_string(&mut log);
            panic!("{arguments:?} runs on:\n{log}");
        }
        thread::sleep(ms(2));
    }
    child.wait_with_output().expect("its output")
}

/// Ends threads that run while a flag is set, also when the test fails, which waits for them.
pub struct Ends<'a>(pub &'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Relaxed);
    }
}

/// Waits for something that is bound to happen.
pub fn until(what: &str, mut happened: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(20);
    while !happened() {
        assert!(Instant::now() < deadline, "never: {what}");
        thread::sleep(ms(2));
    }
}
