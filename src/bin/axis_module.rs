//! The firmware of a PID interface module: it closes the position loop of one axis. docs/module.md is about it.
#![no_std]
#![no_main]

use embassy_executor::Spawner;
use embassy_time::{Duration, Ticker};
use puente::clock;
use puente::module::control::{Control, Servo};
use puente::module::{lamp, setup};
use puente::port::{self, Axis, AxisBoard, Lamp};

static CONTROL: Control<Axis> = Control::new();

#[cortex_m_rt::entry]
fn main() -> ! {
    port::run(start)
}

/// Starts the module, whose tasks go on after this returns.
fn start(spawner: Spawner) {
    let board = AxisBoard::start(spawner, setup::LINE, setup::FEEDBACK, setup::COMMAND);
    let config = setup::config(setup::FEEDBACK);
    let rate = config.rate;
    CONTROL.set(Servo::new(board.axis, config).expect("a setting of setup.rs"));
    board.tick.start(rate, || CONTROL.step(clock::now()));
    spawner.spawn(lamp_task(board.lamp).expect("one lamp"));
}

/// Shows the state.
#[embassy_executor::task]
async fn lamp_task(mut lamp: Lamp) -> ! {
    let mut ticker = Ticker::every(Duration::from_hz(lamp::RATE.into()));
    for step in (0..).cycle() {
        if let Some(status) = CONTROL.status() {
            lamp.show(lamp::lit(status.state, step));
        }
        CONTROL.alive();
        ticker.next().await;
    }
    unreachable!()
}
