//! The host program: options, settings, and two threads, one for the buses and one for the clients.

use std::fmt::Display;
use std::io::Write;
use std::process::ExitCode;

use embassy_executor::Executor;
use static_cell::StaticCell;

use super::options::{Action, Options, USAGE};
use super::{bus_task, front_task, line_settings, master, mode, watch_task};
use crate::clock;
use crate::front::Gateway;
use crate::port::host::{Doors, LineSpec, exact_timers, start_log};
use crate::port::{Line, Place, limits};
use crate::settings::{Bus, Settings};

/// How long the end of the program waits for the drives to confirm their stops.
const FAREWELL: std::time::Duration = std::time::Duration::from_secs(5);

/// Runs the gateway; comes back only where it does not start, or where it was asked for less.
pub fn main() -> ExitCode {
    start_log();
    let options = match Options::parse(lexopt::Parser::from_env()) {
        Ok(options) => options,
        Err(error) => return fail(format_args!("{error}; --help lists the options")),
    };
    match options.action {
        Action::Help => return print(USAGE),
        Action::Version => return print(concat!("puente ", env!("CARGO_PKG_VERSION"), "\n")),
        Action::Run | Action::Check | Action::Print => {}
    }
    let (settings, lines) = match load(&options) {
        Ok(loaded) => loaded,
        Err(error) => return fail(error),
    };
    match options.action {
        Action::Check => print("ok the settings are valid\n"),
        Action::Print => match toml::to_string(&settings) {
            Ok(text) => print(&text),
            Err(error) => fail(error),
        },
        _ => run(settings, lines),
    }
}

fn print(text: &str) -> ExitCode {
    match std::io::stdout().write_all(text.as_bytes()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}

fn fail(error: impl Display) -> ExitCode {
    eprintln!("error: {error}");
    ExitCode::FAILURE
}

/// The settings in force, and the line of each bus; nothing is opened yet.
fn load(options: &Options) -> Result<(Settings, Vec<LineSpec>), String> {
    let (mut settings, place) = match &options.config {
        None => (Settings::factory("sim"), String::new()),
        Some(path) => {
            let text =
                std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
            let settings = toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
            (settings, format!("{}: ", path.display()))
        }
    };
    settings.net.bind = options.bind.unwrap_or(settings.net.bind);
    settings.net.port = options.port.unwrap_or(settings.net.port);
    settings.net.modbus_port = options.modbus_port.unwrap_or(settings.net.modbus_port);
    settings.check().map_err(|problem| format!("{place}{problem}"))?;
    let line = |bus: &Bus| {
        LineSpec::parse(&bus.port, line_settings(bus), || simulated(&settings, bus))
            .map_err(|error| format!("{place}[[bus]] \"{}\" port: {error}", bus.name))
    };
    let lines = settings.buses.iter().map(line).collect::<Result<_, _>>()?;
    Ok((settings, lines))
}

/// The cell behind a simulated bus: a drive for each of its axes.
fn simulated(settings: &Settings, bus: &Bus) -> puente_cell::Config {
    let of_bus = settings.axes.iter().filter(|axis| axis.bus == bus.name);
    let addresses: Vec<u8> = of_bus.map(|axis| axis.address).collect();
    puente_cell::Config::new(mode(bus), line_settings(bus), &addresses)
}

fn run(settings: Settings, lines: Vec<LineSpec>) -> ExitCode {
    exact_timers();
    let doors = match Doors::open(settings.net.bind, settings.net.port, settings.net.modbus_port) {
        Ok(doors) => doors,
        Err(error) => return fail(error),
    };
    let (main, modbus) = match doors.addresses() {
        Ok(addresses) => addresses,
        Err(error) => return fail(error),
    };
    let gateway = super::build(Box::leak(Box::new(settings)));
    if let Err(error) = ctrlc::set_handler(move || end(gateway)) {
        return fail(error);
    }
    std::thread::spawn(move || buses(gateway, lines));
    if print(&format!("ready http://{main} modbus-tcp://{modbus}\n")) == ExitCode::FAILURE {
        return fail("standard output is closed");
    }
    clients(gateway, doors)
}

/// Ctrl-C, SIGTERM or SIGHUP: stops the axes that are under a lease, then ends the program.
fn end(gateway: &Gateway) {
    gateway.desk.close(clock::now());
    let deadline = std::time::Instant::now() + FAREWELL;
    while !gateway.desk.at_rest() && std::time::Instant::now() < deadline {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    if gateway.desk.at_rest() {
        std::process::exit(0);
    }
    log::error!("an axis may still move: its stop was not confirmed");
    std::process::exit(1);
}

/// The thread of the buses, so that no client delays them.
fn buses(gateway: &'static Gateway, lines: Vec<LineSpec>) -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    EXECUTOR.init(Executor::new()).run(|spawner| {
        for ((index, spec), bus) in (0..).zip(lines).zip(&gateway.settings.buses) {
            spawner.spawn(
                bus_task(gateway.desk, index, Line::new(spec), master(gateway.settings, bus))
                    .expect("one task a bus"),
            );
        }
        for (axis, _) in gateway.axes.iter() {
            spawner.spawn(watch_task(gateway, axis).expect("one task an axis"));
        }
    })
}

/// The thread of the clients.
fn clients(gateway: &'static Gateway, doors: Doors) -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    let places = usize::from(gateway.settings.net.clients) + limits::SLOTS - limits::CLIENTS;
    EXECUTOR.init(Executor::new()).run(|spawner| {
        for seat in 0..places.min(limits::SLOTS) {
            spawner.spawn(front_task(gateway, seat as u8, Place(doors.clone())).expect("one task a place"));
        }
    })
}
