//! The firmware: settings, and two executors, one for the buses and one for the clients.

use embassy_executor::Spawner;

use super::{InForce, bus_task, front_task, keeper_task, line_settings, master, watch_task};
use crate::front::Gateway;
use crate::port::embedded::{Address, Network};
use crate::port::{Board, Place};
use crate::settings::Net;

/// Starts the gateway, whose tasks go on after this returns. Call it once, first of all.
///
/// Neither this nor what it calls is inlined: each takes much of the stack for a moment, and not all at once.
#[inline(never)]
pub fn start(spawner: Spawner) {
    let mut board = Board::start(spawner);
    let InForce { settings, keeper, store } = super::settings(board.flash.take(), None, board.button);
    let network = board.connect(spawner, address(&settings.net));
    log::info!("puente {} at {}, MAC {:02x?}", env!("CARGO_PKG_VERSION"), settings.net.address, network.mac);
    let gateway = super::build(settings, keeper);
    buses(gateway, &mut board);
    if let Some(store) = store {
        spawner.spawn(keeper_task(keeper, gateway.desk, store).expect("one task"));
    }
    clients(gateway, &network, spawner);
}

fn address(net: &Net) -> Address {
    Address {
        ip: net.address.address.octets(),
        prefix: net.address.prefix,
        gateway: net.router.map(|router| router.octets()),
    }
}

/// The buses run above the clients, so that no client delays them.
fn buses(gateway: &'static Gateway, board: &mut Board) {
    for index in (0..).take(gateway.settings.buses.len()) {
        bus(gateway, board, index);
    }
    for (axis, _) in gateway.axes.iter() {
        board.buses.spawn(watch_task(gateway, axis).expect("one task an axis"));
    }
}

#[inline(never)]
fn bus(gateway: &'static Gateway, board: &mut Board, index: u8) {
    let Some(bus) = gateway.settings.buses.get(usize::from(index)) else { return };
    match board.lines.open(&bus.port, line_settings(bus)) {
        Ok(line) => board.buses.spawn(
            bus_task(gateway.desk, index, line, master(gateway.settings, bus)).expect("one task a bus"),
        ),
        Err(error) => log::error!("[[bus]] \"{}\" port: {error}", bus.name),
    }
}

#[inline(never)]
fn clients(gateway: &'static Gateway, network: &Network, spawner: Spawner) {
    let net = &gateway.settings.net;
    for (seat, place) in (0..).zip(network.places(net.port, net.modbus_port)) {
        client(gateway, spawner, seat, place);
    }
}

#[inline(never)]
fn client(gateway: &'static Gateway, spawner: Spawner, seat: u8, place: Place) {
    spawner.spawn(front_task(gateway, seat, place).expect("one task a place"));
}
