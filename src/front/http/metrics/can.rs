//! What is measured of CANopen buses.

use embedded_io_async::Write;

use super::super::super::{End, Gateway};
use super::super::reply::Reply;
use super::{Count, events, family};
use crate::clock;
use crate::desk::CanStatistics;
use crate::port::CanState;

/// Frames, and what became of some.
const FRAMES: [Count<CanStatistics>; 5] = [
    ("received", |counted| counted.received),
    ("sent", |counted| counted.sent),
    ("not-sent", |counted| counted.undelivered),
    ("not-received", |counted| counted.port.lost),
    ("client-too-slow", |counted| counted.lost),
];

/// What happened on a bus.
const EVENTS: [Count<CanStatistics>; 5] = [
    ("bus-off", |counted| counted.port.bus_offs),
    ("booted", |counted| counted.manager.booted),
    ("emergency", |counted| counted.manager.emergencies),
    ("sync-missed", |counted| counted.manager.sync_missed),
    ("untold", |counted| counted.manager.untold),
];

/// What became of SDO transfers.
const SDO: [Count<CanStatistics>; 8] = [
    ("begun", |counted| counted.manager.sdo.transfers),
    ("completed", |counted| counted.manager.sdo.completed),
    ("aborted", |counted| counted.manager.sdo.aborted),
    ("timeout", |counted| counted.manager.sdo.timeouts),
    ("repeated", |counted| counted.manager.sdo.repeated),
    ("late", |counted| counted.manager.sdo.late),
    ("unpaired", |counted| counted.manager.sdo.unpaired),
    ("not-sent", |counted| counted.not_sent),
];

const STATES: [CanState; 5] =
    [CanState::Active, CanState::Warning, CanState::Passive, CanState::Off, CanState::Down];

type Gauge = (&'static str, &'static str, fn(&CanStatistics) -> u32);

const GAUGES: [Gauge; 4] = [
    ("puente_can_load_permille", "Bus load in the last second, of the bit rate.", |counted| {
        counted.load_permille
    }),
    ("puente_can_tx_errors", "Transmit error counter of the port.", |counted| counted.port.tx_errors.into()),
    ("puente_can_rx_errors", "Receive error counter of the port.", |counted| counted.port.rx_errors.into()),
    ("puente_sdo_waiting", "SDO transfers that wait for their turn.", |counted| counted.waiting as u32),
];

/// Every CANopen bus with its number, name and statistics.
fn counted(gateway: &Gateway) -> impl Iterator<Item = (u8, &str, CanStatistics)> {
    let statistics = |index| gateway.desk.can_statistics(clock::now(), index).unwrap_or_default();
    let buses = (0..).zip(&gateway.settings.buses).filter(|(_, bus)| bus.canopen().is_some());
    buses.map(move |(index, bus)| (index, bus.name.as_str(), statistics(index)))
}

/// Sends all of it; nothing where there is no CANopen bus.
pub(super) async fn send<W: Write>(gateway: &Gateway, reply: &mut Reply<'_, W>) -> Result<(), End> {
    if counted(gateway).next().is_none() {
        return Ok(());
    }
    let buses = || counted(gateway).map(|(_, bus, counted)| (bus, counted));
    events(reply, "puente_can_frames_total", "Frames of a CANopen bus.", buses(), &FRAMES).await?;
    events(reply, "puente_canopen_events_total", "What happened on a CANopen bus.", buses(), &EVENTS).await?;
    events(reply, "puente_sdo_transfers_total", "SDO transfers, by what became of them.", buses(), &SDO)
        .await?;
    const BITS: &str = "puente_can_bits_total";
    family(reply, BITS, "counter", "Bits of all frames, with stuff bits and intermission.").await?;
    for (bus, counted) in buses() {
        reply.put(format_args!("{BITS}{{bus=\"{bus}\"}} {}\n", counted.bits)).await?;
    }
    for (name, help, value) in GAUGES {
        family(reply, name, "gauge", help).await?;
        for (bus, counted) in buses() {
            reply.put(format_args!("{name}{{bus=\"{bus}\"}} {}\n", value(&counted))).await?;
        }
    }
    const STATE: &str = "puente_can_state";
    family(reply, STATE, "gauge", "1 for the state that the port is in.").await?;
    for (bus, counted) in buses() {
        for state in STATES {
            let is = u8::from(counted.state == state);
            let state = state.name();
            reply.put(format_args!("{STATE}{{bus=\"{bus}\",state=\"{state}\"}} {is}\n")).await?;
        }
    }
    const NODES: &str = "puente_canopen_nodes";
    family(reply, NODES, "gauge", "Nodes that are configured, or have been heard.").await?;
    for (index, bus, _) in counted(gateway) {
        let nodes = gateway.desk.nodes(index).count();
        reply.put(format_args!("{NODES}{{bus=\"{bus}\"}} {nodes}\n")).await?;
    }
    Ok(())
}
