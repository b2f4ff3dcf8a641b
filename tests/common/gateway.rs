//! A running gateway, on either target.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::thread;

use puente_cell::Cell;
use puente_emulator::{Emulator, Setup};

use super::rig::Rig;
use super::wire::Wire;
use super::{Document, board, client, ms, scratch, target, until};

/// A running gateway; it ends with the test, which fails where the gateway has ended or failed before.
pub struct Gateway {
    process: Process,
    config: Option<PathBuf>,
    log: Log,
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

    /// How often a board has started.
    fn starts(&self) -> usize {
        self.text().matches("INFO ] puente ").count()
    }

    fn text(&self) -> String {
        self.0.lock().expect("the log").clone()
    }
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
            return Self::run(None, vec!["sim".into()]);
        }
        let Rig { wire, mut gateway } = Rig::on_board(|_| {});
        gateway._cell = Some(wire);
        gateway
    }

    fn on_host(document: &Document) -> Self {
        let ports: Vec<String> = document.places().map(|place| place.port()).collect();
        let config = scratch("settings.toml");
        fs::write(&config, document.text(&ports)).expect("a settings file");
        Self::run(Some(config), ports)
    }

    fn run(config: Option<PathBuf>, ports: Vec<String>) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gateway"));
        if let Some(config) = &config {
            command.arg("--config").arg(config);
        }
        command.args(["--port", "0", "--modbus-port", "0"]).env("RUST_LOG", "info");
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        let log = Log::default();
        let (stderr, lines) = (child.stderr.take().expect("its log"), log.clone());
        thread::spawn(move || {
            BufReader::new(stderr).lines().map_while(Result::ok).for_each(|line| lines.push(&line));
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
            panic!("'{ready}' is not the line `ready`; log:\n{}", log.text());
        };
        Self { process: Process::Host(child), config, log, fails: false, main, modbus, ports, _cell: None }
    }

    fn on_board_with(image: &Path, document: &Document) -> Self {
        let mut places = document.places().map(|place| place.address().expect("a port"));
        let lines = [places.next(), places.next()];
        assert!(places.next().is_none(), "a board has two lines");
        let setup =
            Setup { image: image.into(), lines, ports: [0, 0], ethernet: None, button: false, plugin: None };
        let gateway = Self::on_board(&setup);
        let settings = board::json(&document.text(&gateway.ports));
        board::put(gateway.main, &settings);
        document.go_live();
        until("it starts anew", || gateway.log.starts() == 2);
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
            log,
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
