//! The firmware: settings, and two executors, one for the buses and one for the clients.

use embassy_executor::Spawner;

use super::{bus_task, front_task, line_settings, master, watch_task};
use crate::port::Board;
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
}

/// The settings of every start, until they can be kept in flash.
fn settings() -> Settings {
    let mut settings = Settings::factory("rs485-a");
    settings.net.bind = Board::ADDRESS.ip.into();
    settings.net.port = 80;
    settings.net.modbus_port = 502;
    settings
}
