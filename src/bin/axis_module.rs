//! The firmware of a PID interface module: it closes the position loop of one axis. docs/module.md is about it.
#![no_std]
#![no_main]

use embassy_executor::Spawner;
use embassy_time::{Duration, Ticker};
use puente::module::control::{Control, Servo};
use puente::module::{bus, lamp, setup};
use puente::port::{self, Axis, AxisBoard, Lamp, Line};
use puente_modules::node::{self, Loop};
use static_cell::StaticCell;

static CONTROL: StaticCell<Control<Axis>> = StaticCell::new();

#[cortex_m_rt::entry]
fn main() -> ! {
    port::run(start)
}

/// Starts the module, whose tasks go on after this returns.
fn start(spawner: Spawner) {
    let board = AxisBoard::start(spawner, setup::BUS, setup::FEEDBACK, setup::COMMAND);
    let address = setup::FIRST_ADDRESS + board.switch;
    log::info!("puente {}, PID interface module {address}", env!("CARGO_PKG_VERSION"));
    tell_history();
    let config = setup::config(setup::FEEDBACK);
    let rate = config.rate;
    let control =
        &*CONTROL.init(Control::new(Servo::new(board.axis, config).expect("settings in their ranges")));
    board.tick.start(rate, control);
    let config = bus::config(board.bus, address, setup::FORM);
    board.buses.spawn(bus_task(board.line, config, board.seed, control).expect("one bus"));
    spawner.spawn(lamp_task(board.lamp, control).expect("one lamp"));
}

/// Says why the board has started, and what it failed of.
fn tell_history() {
    let Some(history) = port::history() else { return };
    log::info!("started after {}", history.cause.name());
    for incident in [history.crash, history.watchdog].into_iter().flatten() {
        log::warn!("failed once: {}", incident.text);
    }
}

/// Serves the bus.
#[embassy_executor::task]
async fn bus_task(mut line: Line, config: node::Config, seed: u64, control: &'static Control<Axis>) -> ! {
    bus::serve(&mut line, config, seed, control).await
}

/// Shows the state.
#[embassy_executor::task]
async fn lamp_task(mut lamp: Lamp, control: &'static Control<Axis>) -> ! {
    let mut ticker = Ticker::every(Duration::from_hz(lamp::RATE.into()));
    let mut step = 0_u32;
    loop {
        lamp.show(lamp::lit(control.status().state, step));
        step = step.wrapping_add(1);
        port::alive();
        ticker.next().await;
    }
}
