//! A running gateway, on either target.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use puente_cell::Cell;
use puente_emulator::{ADDRESSED, Emulator, Setup};

use super::rig::Rig;
use super::wire::Wire;
use super::{Document, board, client, ms, scratch, target};

/// Longer than a start may take that follows a trial of settings.
const PATIENCE: Duration = Duration::from_secs(100);

/// A running gateway; it ends with the test, which fails where the gateway has ended or failed before.
pub struct Gateway {
    process: Process,
    config: Option<PathBuf>,
    flash: Option<PathBuf>,
    log: Log,
    /// Where it listened after each start, on the host.
    ready: Arc<Mutex<Vec<Addresses>>>,
    /// Starts that the test has seen.
    starts: usize,
    fails: bool,
    /// The port of every dialect.
    pub main: SocketAddr,
    /// The port of Modbus/TCP alone.
    pub modbus: SocketAddr,
    /// What its settings call the lines of its buses, in their order.
    pub ports: Vec<String>,
    /// The drives of the factory settings, where they are not simulated by the gateway itself.
    _cell: Option<Wire<Cell>>,
}

/// Of the port of every dialect, and of that of Modbus/TCP alone.
type Addresses = (SocketAddr, SocketAddr);

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

/// What a gateway has said.
#[derive(Clone, Default)]
struct Log(Arc<Mutex<String>>);

impl Log {
    fn push(&self, line: &str) {
        let mut log = self.0.lock().expect("the log");
        log.push_str(line);
        log.push('\n');
    }

    /// How often a board has started and got its address.
    fn starts(&self) -> usize {
        self.text().matches(ADDRESSED).count()
    }

    fn text(&self) -> String {
        self.0.lock().expect("the log").clone()
    }
}

/// Starts the program. Where it listens is noted each time that it says so.
fn launch(
    config: Option<&Path>,
    flash: Option<&Path>,
    log: &Log,
    ready: &Arc<Mutex<Vec<Addresses>>>,
) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_gateway"));
    for (option, file) in [("--config", config), ("--flash", flash)] {
        if let Some(file) = file {
            command.arg(option).arg(file);
        }
    }
    command.args(["--port", "0", "--modbus-port", "0"]).env("RUST_LOG", "info");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
    let (stderr, log) = (child.stderr.take().expect("its log"), log.clone());
    thread::spawn(move || {
        BufReader::new(stderr).lines().map_while(Result::ok).for_each(|line| log.push(&line));
    });
    let (stdout, ready) = (child.stdout.take().expect("its output"), ready.clone());
    thread::spawn(move || {
        for line in BufReader::new(stdout).lines().map_while(Result::ok) {
            let addresses = line.strip_prefix("ready http://").and_then(|rest| {
                let (main, rest) = rest.split_once(" modbus-tcp://")?;
                let modbus = rest.split(' ').next()?;
                Some((main.parse().ok()?, modbus.parse().ok()?))
            });
            let addresses = addresses.unwrap_or_else(|| panic!("'{line}' is not the line `ready`"));
            ready.lock().expect("addresses").push(addresses);
        }
    });
    child
}

impl Gateway {
    /// Starts with these settings, on ports that the system chooses.
    pub fn start(document: &Document) -> Self {
        match &target().image {
            Some(image) => Self::on_board_with(image, document),
            None => Self::on_host(document),
        }
    }

    /// Starts with the factory settings, and three drives on the line.
    pub fn factory() -> Self {
        if !target().is_board() {
            return Self::run(None, None, vec!["sim".into()]);
        }
        let Rig { wire, mut gateway } = Rig::on_board(|_| {});
        gateway._cell = Some(wire);
        gateway
    }

    /// Starts the program on this machine, whatever the target is.
    pub fn on_host(document: &Document) -> Self {
        Self::on_host_with(document, None)
    }

    /// Starts on this machine with these settings, and with flash for others.
    pub fn with_flash(document: &Document) -> Self {
        Self::on_host_with(document, Some(scratch("flash")))
    }

    fn on_host_with(document: &Document, flash: Option<PathBuf>) -> Self {
        let ports = document.host_ports();
        let config = scratch("settings.toml");
        fs::write(&config, document.text(&ports)).expect("a settings file");
        Self::run(Some(config), flash, ports)
    }

    /// Starts on this machine with an example's settings.
    pub fn example(name: &str) -> Self {
        let config = scratch(name);
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(name);
        fs::copy(example, &config).expect("an example");
        Self::run(Some(config), None, vec!["sim".into()])
    }

    fn run(config: Option<PathBuf>, flash: Option<PathBuf>, ports: Vec<String>) -> Self {
        let (log, ready) = (Log::default(), Arc::default());
        let process = Process::Host(launch(config.as_deref(), flash.as_deref(), &log, &ready));
        // Anything, until it has said where it listens.
        let nowhere = SocketAddr::from(([127, 0, 0, 1], 0));
        let (main, modbus) = (nowhere, nowhere);
        let mut gateway = Self {
            process,
            config,
            flash,
            log,
            ready,
            starts: 0,
            fails: false,
            main,
            modbus,
            ports,
            _cell: None,
        };
        gateway.await_start();
        gateway
    }

    /// Waits until it has started once more.
    pub fn await_start(&mut self) {
        self.starts += 1;
        let deadline = Instant::now() + PATIENCE;
        loop {
            let ended = self.process.ended();
            assert!(ended.is_none() && Instant::now() < deadline, "no start; log:\n{}", self.log());
            if let Process::Board(_) = &self.process {
                if self.log.starts() >= self.starts {
                    return;
                }
            } else if let Some(addresses) = self.ready.lock().expect("addresses").get(self.starts - 1) {
                (self.main, self.modbus) = *addresses;
                return;
            }
            thread::sleep(ms(5));
        }
    }

    /// Takes its power, and gives it back. What is in the flash of an emulated board stays.
    pub fn cycle_power(&mut self) {
        match &mut self.process {
            Process::Board(board) => {
                board.monitor("system_reset").expect("an answer");
            }
            Process::Host(child) => {
                child.kill().expect("killed");
                child.wait().expect("its end");
                *child = launch(self.config.as_deref(), self.flash.as_deref(), &self.log, &self.ready);
            }
            Process::Ended => panic!("it has ended"),
        }
        self.await_start();
    }

    fn on_board_with(image: &Path, document: &Document) -> Self {
        let two = |can| {
            let mut places = document.places(can).map(|place| place.address().expect("a port"));
            let two = [places.next(), places.next()];
            assert!(places.next().is_none(), "a board has two lines, and two CAN buses");
            two
        };
        let nowhere = SocketAddr::from(([127, 0, 0, 1], 0));
        let setup = Setup { lines: two(false), cans: two(true), ..Setup::new(image, nowhere) };
        let mut gateway = Self::on_board(&setup);
        gateway.ports = document.board_ports();
        let settings = board::json(&document.text(&gateway.ports));
        board::put(gateway.main, &settings);
        document.go_live();
        gateway.await_start();
        assert!(board::has(gateway.main, &settings), "other settings than {settings}");
        gateway
    }

    /// Starts an emulated board with its factory settings.
    pub fn on_board(setup: &Setup) -> Self {
        let log = Log::default();
        let lines = log.clone();
        let board = Emulator::start(setup, move |line| lines.push(line))
            .unwrap_or_else(|error| panic!("{error}; log:\n{}", log.text()));
        let (main, modbus) = (board.main, board.modbus);
        let connected = board::LINES.iter().zip(setup.lines).filter(|(_, line)| line.is_some());
        let ports = connected.map(|(&name, _)| name.into()).collect();
        Self {
            process: Process::Board(board),
            config: None,
            flash: None,
            log,
            ready: Arc::default(),
            starts: 1,
            fails: false,
            main,
            modbus,
            ports,
            _cell: None,
        }
    }

    /// Ends it by SIGTERM, as a service manager does. On the host alone.
    pub fn terminate(&mut self) -> ExitStatus {
        let Process::Host(mut child) = std::mem::replace(&mut self.process, Process::Ended) else {
            panic!("it runs on this machine");
        };
        let kill = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
        assert!(kill.expect("kill").success());
        child.wait().expect("its end")
    }

    /// Ends it at once, as a crash or the loss of power does: the program by SIGKILL, a board with its emulator.
    pub fn kill(&mut self) {
        match std::mem::replace(&mut self.process, Process::Ended) {
            Process::Host(mut child) => {
                child.kill().expect("killed");
                child.wait().expect("its end");
            }
            Process::Board(board) => drop(board),
            Process::Ended => panic!("it has ended"),
        }
    }

    /// The process that it runs in.
    pub fn process(&self) -> u32 {
        match &self.process {
            Process::Host(child) => child.id(),
            Process::Board(board) => board.id(),
            Process::Ended => panic!("it has ended"),
        }
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

    /// What it has logged.
    pub fn log(&self) -> String {
        self.log.text()
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
        for file in [&self.config, &self.flash].into_iter().flatten() {
            let _ = fs::remove_file(file);
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
