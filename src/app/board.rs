//! The firmware: settings, and two executors, one for the buses and one for the clients.

use embassy_executor::Spawner;

use super::vital::feeder_task;
use super::{bus_task, front_task, line_settings, master, watch_task};
use crate::clock;
use crate::front::Gateway;
use crate::port::record::Reset;
use crate::port::{self, Board};
use crate::settings::Settings;

/// Starts the gateway, whose tasks go on after this returns. Call it once, first of all.
///
/// Not inlined: what it takes of the stack has to be free again when the tasks run.
#[inline(never)]
pub fn start(spawner: Spawner) {
    let settings = settings();
    let mut board = Board::start(spawner, Board::ADDRESS);
    log::info!("puente {} at {}, MAC {:02x?}", env!("CARGO_PKG_VERSION"), settings.net.bind, board.mac);
    let places = board.places(settings.net.port, settings.net.modbus_port);
    let gateway = super::build(settings);
    resume(gateway, board.moving);

    // The buses run above the clients, so that no client delays them.
    for (index, bus) in (0..).zip(&gateway.settings.buses) {
        match board.lines.open(&bus.port, line_settings(bus)) {
            Ok(line) => {
                board.buses.spawn(
                    bus_task(gateway.desk, index, line, master(&gateway.settings, bus))
                        .expect("one task a bus"),
                );
            }
            Err(error) => log::error!("[[bus]] \"{}\" port: {error}", bus.name),
        }
    }
    for (axis, _) in gateway.axes.iter() {
        board.buses.spawn(watch_task(gateway, axis).expect("one task an axis"));
    }
    for (seat, place) in (0..).zip(places) {
        spawner.spawn(front_task(gateway, seat, place).expect("one task a place"));
    }
    spawner.spawn(feeder_task(gateway).expect("one feeder"));
}

/// Tells why the board has started, and has the axes stopped that may have moved when it was reset.
fn resume(gateway: &Gateway, moving: u32) {
    let Some(history) = port::history().filter(|history| history.cause != Reset::PowerOn) else { return };
    log::warn!("started after {}", history.cause.name());
    for (axis, _) in gateway.axes.iter().filter(|(axis, _)| moving >> axis & 1 != 0) {
        gateway.desk.restarted(clock::now(), axis);
    }
}

/// The settings of every start, until they can be kept in flash.
fn settings() -> Settings {
    let mut settings = Settings::factory("rs485-a");
    settings.net.bind = Board::ADDRESS.ip.into();
    settings.net.port = 80;
    settings.net.modbus_port = 502;
    settings
}
