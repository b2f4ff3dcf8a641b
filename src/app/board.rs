//! The firmware: settings, and two executors, one for the buses and one for the clients.

use embassy_executor::Spawner;

use super::canopen::canopen;
use super::framed::framed;
use super::vital::feeder_task;
use super::{
    InForce, bus_task, canopen_task, framed_task, front_task, group_task, keeper_task, lamps, modbus,
    watch_task,
};
use crate::clock;
use crate::front::Gateway;
use crate::port::embedded::Address;
use crate::port::record::Reset;
use crate::port::{self, Board, Can, Leds, Line, Network, Place};
use crate::settings::{Framed, Modbus, Net, Protocol};

/// Starts the gateway, whose tasks go on after this returns. Call it once, first of all.
///
/// Neither this nor what it calls is inlined: each takes much of the stack for a moment, and not all at once.
#[inline(never)]
pub fn start(spawner: Spawner) {
    let mut board = Board::start(spawner);
    log::info!("puente {}, MAC {:02x?}", env!("CARGO_PKG_VERSION"), board.mac);
    let InForce { settings, keeper, store } = super::settings(board.flash.take(), None, board.button);
    let gateway = super::build(settings, keeper);
    let failed = resume(gateway, board.moving);
    let whole = buses(gateway, &mut board) && !failed;
    clients(gateway, &board.network, spawner);
    let net = &gateway.settings.net;
    board.network.join(spawner, address(net), net.port, net.modbus_port);
    if let Some(store) = store {
        spawner.spawn(keeper_task(keeper, gateway.desk, store).expect("one keeper"));
    }
    spawner.spawn(feeder_task(gateway).expect("one feeder"));
    let lamps = lamps_task(gateway, board.network, board.leds, whole);
    spawner.spawn(lamps.expect("the lamps are started once"));
}

#[inline(never)]
fn address(net: &Net) -> Address {
    Address {
        dhcp: net.dhcp,
        ip: net.address.address.octets(),
        prefix: net.address.prefix,
        router: net.router.map(|router| router.octets()),
        hostname: net.hostname.clone(),
    }
}

/// Tells why the board has started, and has the axes stopped that may have moved when it was reset. True where the
/// firmware had failed.
#[inline(never)]
fn resume(gateway: &Gateway, moving: u32) -> bool {
    let Some(history) = port::history().filter(|history| history.cause != Reset::PowerOn) else {
        return false;
    };
    log::warn!("started after {}", history.cause.name());
    for (axis, _) in gateway.axes.iter().filter(|(axis, _)| moving >> axis & 1 != 0) {
        gateway.desk.restarted(clock::now(), axis);
    }
    history.cause.is_failure()
}

/// The buses run above the clients, so that no client delays them. False where one of them does not run.
fn buses(gateway: &'static Gateway, board: &mut Board) -> bool {
    let mut whole = true;
    for index in (0..).take(gateway.settings.buses.len()) {
        whole &= bus(gateway, board, index);
    }
    for (axis, _) in gateway.axes.iter() {
        board.buses.spawn(watch_task(gateway, axis).expect("one task an axis"));
    }
    board.buses.spawn(group_task(gateway).expect("one task"));
    whole
}

#[inline(never)]
fn bus(gateway: &'static Gateway, board: &mut Board, index: u8) -> bool {
    let Some(bus) = gateway.settings.buses.get(usize::from(index)) else { return false };
    let opened = match &bus.protocol {
        Protocol::ModbusRtu(Modbus { line, .. })
        | Protocol::ModbusAscii(Modbus { line, .. })
        | Protocol::Framed(Framed { line, .. }) => {
            board.lines.open(&bus.port, *line).map(|line| serial(gateway, board, index, line))
        }
        Protocol::Canopen(canopen) => {
            board.cans.open(&bus.port, canopen.bitrate).map(|port| can(gateway, board, index, port))
        }
    };
    if let Err(error) = &opened {
        log::error!("[[bus]] \"{}\" port: {error}", bus.name);
    }
    opened.is_ok()
}

#[inline(never)]
fn serial(gateway: &'static Gateway, board: &Board, index: u8, line: Line) {
    let master = gateway.settings.buses.get(usize::from(index)).and_then(|bus| modbus(gateway.settings, bus));
    if let Some(master) = master {
        board.buses.spawn(bus_task(gateway.desk, index, line, master).expect("one task a bus"));
    } else if let Some((image, setup)) = framed(gateway.settings, index, board.seed) {
        board.buses.spawn(framed_task(image, line, setup).expect("no more than are allowed"));
    }
}

#[inline(never)]
fn can(gateway: &'static Gateway, board: &Board, index: u8, port: Can) {
    if let Some(parts) = canopen(gateway.settings, index) {
        board.buses.spawn(canopen_task(port, parts).expect("no more than are allowed"));
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

/// Shows the state of the gateway.
#[embassy_executor::task]
async fn lamps_task(gateway: &'static Gateway, network: Network, mut leds: Leds, whole: bool) -> ! {
    lamps::show(gateway, &mut leds, || network.link(), whole).await
}
