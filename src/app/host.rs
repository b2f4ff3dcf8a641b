//! The host program: options, settings, and two threads, one for the buses and one for the clients.

use std::fmt::Display;
use std::io::Write;
use std::process::ExitCode;

use embassy_executor::Executor;
use static_cell::StaticCell;

use super::canopen::canopen;
use super::framed::framed;
use super::options::{Action, Options, USAGE};
use super::simulated::{simulated, simulated_can};
use super::{
    InForce, bus_task, canopen_task, framed_task, front_task, group_task, keeper_task, modbus, watch_task,
};
use crate::clock;
use crate::front::Gateway;
use crate::port::host::{CanSpec, Doors, LineSpec, Ports, exact_timers, random, start_log};
use crate::port::{Can, Flash, Line, Place, limits};
use crate::settings::store::Store;
use crate::settings::{Bus, Framed, Modbus, Problem, Protocol, Settings, VERSION};

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
    let base = match read(&options) {
        Ok(base) => base,
        Err(error) => return fail(error),
    };
    match options.action {
        Action::Check => print("ok the settings are valid\n"),
        Action::Print => match toml::to_string(&options.on(&base)) {
            Ok(text) => print(&text),
            Err(error) => fail(error),
        },
        _ => run(&options, base),
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

/// The settings of the file, or those that are built in. With the options they hold.
fn read(options: &Options) -> Result<Settings, String> {
    let Some(path) = &options.config else {
        let settings = Settings::factory();
        return checked(options, &settings, "").map(|()| settings);
    };
    let place = format!("{}: ", path.display());
    let text = std::fs::read_to_string(path).map_err(|error| format!("{place}{error}"))?;
    let settings = toml::from_str(&text).map_err(|error| match version(&text) {
        Some(version) if version != VERSION => format!("{place}{}", Problem::Version(version)),
        _ => format!("{place}{error}"),
    })?;
    checked(options, &settings, &place).map(|()| settings)
}

/// The version that a text gives, whatever else is in it.
fn version(text: &str) -> Option<u32> {
    let table = text.parse::<toml::Table>().ok()?;
    table.get("version")?.as_integer()?.try_into().ok()
}

fn checked(options: &Options, settings: &Settings, place: &str) -> Result<(), String> {
    options.on(settings).check().map_err(|problem| format!("{place}{problem}"))
}

/// Where a bus is.
enum Spec {
    Line(LineSpec),
    Can(CanSpec),
}

/// The port of each bus; nothing is opened yet.
fn ports(settings: &Settings) -> Result<Vec<Spec>, String> {
    let port = |bus: &Bus| {
        match &bus.protocol {
            Protocol::ModbusRtu(Modbus { line, .. })
            | Protocol::ModbusAscii(Modbus { line, .. })
            | Protocol::Framed(Framed { line, .. }) => {
                LineSpec::parse(&bus.port, *line, || simulated(settings, bus)).map(Spec::Line)
            }
            Protocol::Canopen(canopen) => {
                let cell = || simulated_can(settings, bus, canopen.bitrate);
                CanSpec::parse(&bus.port, canopen.bitrate, cell).map(Spec::Can)
            }
        }
        .map_err(|error| format!("[[bus]] \"{}\" port: {error}", bus.name))
    };
    settings.buses.iter().map(port).collect()
}

fn run(options: &Options, base: Settings) -> ExitCode {
    exact_timers();
    let flash = match options.flash.as_deref().map(|path| (path, Flash::open(path))) {
        None => None,
        Some((_, Ok(flash))) => Some(flash),
        Some((path, Err(error))) => return fail(format_args!("{}: {error}", path.display())),
    };
    let base = options.config.as_ref().map(|_| &*Box::leak(Box::new(base)));
    let InForce { settings, keeper, store } = super::settings(flash, base, false);
    let ports = match ports(settings) {
        Ok(ports) => ports,
        Err(error) => return fail(error),
    };
    // The options go before the document, and are no part of it.
    let net = options.on(settings).net;
    let doors = Doors::open(
        net.bind,
        Ports {
            main: net.port,
            modbus: net.modbus_port,
            slcan: net.slcan_port,
            socketcand: net.socketcand_port,
        },
    );
    let doors = match doors {
        Ok(doors) => doors,
        Err(error) => return fail(error),
    };
    let ready = match ready(&doors) {
        Ok(ready) => ready,
        Err(error) => return fail(error),
    };
    let gateway = super::build(settings, keeper);
    if let Err(error) = ctrlc::set_handler(move || end(gateway)) {
        return fail(error);
    }
    std::thread::spawn(move || buses(gateway, ports));
    if print(&ready) == ExitCode::FAILURE {
        return fail("standard output is closed");
    }
    clients(gateway, store, doors)
}

/// The line that tells where the gateway listens.
fn ready(doors: &Doors) -> std::io::Result<String> {
    let mut line = "ready".to_owned();
    for (name, address) in doors.addresses() {
        line += &format!(" {name}://{}", address?);
    }
    Ok(line + "\n")
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
fn buses(gateway: &'static Gateway, ports: Vec<Spec>) -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    let seed = random();
    EXECUTOR.init(Executor::new()).run(|spawner| {
        for ((index, spec), bus) in (0..).zip(ports).zip(&gateway.settings.buses) {
            match spec {
                Spec::Line(spec) => {
                    let line = Line::new(spec);
                    if let Some(master) = modbus(gateway.settings, bus) {
                        spawner.spawn(bus_task(gateway.desk, index, line, master).expect("one task a bus"));
                    } else if let Some((image, setup)) = framed(gateway.settings, index, seed) {
                        spawner.spawn(framed_task(image, line, setup).expect("no more than are allowed"));
                    }
                }
                Spec::Can(spec) => {
                    if let Some(parts) = canopen(gateway.settings, index) {
                        let task = canopen_task(Can::new(spec), parts);
                        spawner.spawn(task.expect("no more than are allowed"));
                    }
                }
            }
        }
        for (axis, _) in gateway.axes.iter() {
            spawner.spawn(watch_task(gateway, axis).expect("one task an axis"));
        }
        spawner.spawn(group_task(gateway).expect("one task"));
    })
}

/// The thread of the clients.
fn clients(gateway: &'static Gateway, store: Option<Store<Flash>>, doors: Doors) -> ! {
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    let places = usize::from(gateway.settings.net.clients) + limits::SLOTS - limits::CLIENTS;
    EXECUTOR.init(Executor::new()).run(|spawner| {
        if let Some(store) = store {
            spawner.spawn(keeper_task(gateway.keeper, gateway.desk, store).expect("one task"));
        }
        for seat in 0..places.min(limits::SLOTS) {
            spawner.spawn(front_task(gateway, seat as u8, Place(doors.clone())).expect("one task a place"));
        }
    })
}
