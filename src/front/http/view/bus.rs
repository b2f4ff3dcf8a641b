//! What is said of a bus, under the names that the settings have, and what was counted on it.

use puente_framed::arbiter;
use puente_line::micros;
use puente_modbus::Counters;
use puente_modules::master;
use serde::Serialize;

use super::Text;
use crate::desk::{CanStatistics, Statistics};
use crate::settings::{self, Protocol};

/// A bus.
#[derive(Serialize)]
#[serde(untagged)]
#[allow(clippy::large_enum_variant, reason = "there is no heap, and one lives at a time")]
pub(in crate::front::http) enum Bus<'a> {
    Modbus(Modbus<'a>),
    Framed(Framed<'a>),
    Canopen(Canopen<'a>),
}

#[derive(Serialize)]
pub(in crate::front::http) struct Framed<'a> {
    name: &'a str,
    protocol: &'static str,
    port: &'a str,
    baud: u32,
    format: Text<puente_line::Format>,
    station: u8,
    policy: settings::Policy,
    cycle_ms: u16,
    ipg: u16,
    slot: u16,
    attempts: u8,
    window: u8,
    echo: settings::Echo,
    statistics: Cycles,
}

#[derive(Serialize)]
pub(in crate::front::http) struct Canopen<'a> {
    name: &'a str,
    protocol: &'static str,
    port: &'a str,
    bitrate: u32,
    node: u8,
    net: u16,
    sync_us: u32,
    sync_overflow: u8,
    heartbeat_ms: u16,
    sdo_timeout_ms: u16,
    client_frames: settings::ClientFrames,
    statistics: Frames,
}

#[derive(Serialize)]
struct Frames {
    state: &'static str,
    /// Of the last second, in % of what the bit rate has room for.
    load_percent: f32,
    received: u32,
    sent: u32,
    bits: u64,
    undelivered: u32,
    lost: u32,
    waiting: usize,
    not_sent: u32,
    sync_missed: u32,
    booted: u32,
    emergencies: u32,
    port: Port,
    sdo: Sdo,
}

#[derive(Serialize)]
struct Port {
    tx_errors: u8,
    rx_errors: u8,
    bus_offs: u32,
    lost: u32,
}

#[derive(Serialize)]
struct Sdo {
    transfers: u32,
    completed: u32,
    aborted: u32,
    timeouts: u32,
    repeated: u32,
    late: u32,
    unpaired: u32,
}

impl Frames {
    fn new(counted: &CanStatistics) -> Self {
        let CanStatistics { port, manager, .. } = counted;
        let sdo = &manager.sdo;
        Self {
            state: counted.state.name(),
            load_percent: counted.load_permille as f32 / 10.0,
            received: counted.received,
            sent: counted.sent,
            bits: counted.bits,
            undelivered: counted.undelivered,
            lost: counted.lost,
            waiting: counted.waiting,
            not_sent: counted.not_sent,
            sync_missed: manager.sync_missed,
            booted: manager.booted,
            emergencies: manager.emergencies,
            port: Port {
                tx_errors: port.tx_errors,
                rx_errors: port.rx_errors,
                bus_offs: port.bus_offs,
                lost: port.lost,
            },
            sdo: Sdo {
                transfers: sdo.transfers,
                completed: sdo.completed,
                aborted: sdo.aborted,
                timeouts: sdo.timeouts,
                repeated: sdo.repeated,
                late: sdo.late,
                unpaired: sdo.unpaired,
            },
        }
    }
}

#[derive(Serialize)]
struct Cycles {
    cycles: u32,
    failed: u32,
    overruns: u32,
    missed: u32,
    /// From the end of one cyclic frame to the end of the next, in µs; 0 before there are two.
    last_cycle_us: u64,
    longest_cycle_us: u64,
    line_down: bool,
    failure: Option<Text<arbiter::Failure>>,
    line: Arbiter,
}

#[derive(Serialize)]
struct Arbiter {
    frames: u32,
    attempts: u32,
    collisions: u32,
    deferrals: u32,
    backoff_us: u64,
    losses: u32,
}

#[derive(Serialize)]
pub(in crate::front::http) struct Modbus<'a> {
    name: &'a str,
    protocol: &'static str,
    port: &'a str,
    baud: u32,
    format: Text<puente_line::Format>,
    units: Text<crate::desk::Units>,
    reply_timeout_ms: u32,
    turnaround_ms: u32,
    rest_ms: u32,
    quarantine_ms: u32,
    queue_timeout_ms: u32,
    echo: settings::Echo,
    statistics: Counted,
}

#[derive(Serialize)]
pub(super) struct Counted {
    submitted: u32,
    confirmed: u32,
    exceptions: u32,
    broadcasts: u32,
    no_reply: u32,
    expired: u32,
    rested: u32,
    stopped: u32,
    line_down: u32,
    queue_full: u32,
    waiting: usize,
    resting: usize,
    /// Mean time from queueing to reply, in µs; none before the first reply.
    pub(super) latency_mean_us: Option<u64>,
    line: Line,
}

#[derive(Serialize)]
struct Line {
    requests: u32,
    replies: u32,
    exceptions: u32,
    timeouts: u32,
    check_errors: u32,
    wrong_unit: u32,
    wrong_function: u32,
    wrong_length: u32,
    late: u32,
    echoes: u32,
    garbage_bytes: u32,
    line_errors: u32,
}

impl<'a> Bus<'a> {
    pub(in crate::front::http) fn new(
        bus: &'a settings::Bus,
        statistics: &Statistics,
        cycles: &master::Statistics,
        line_down: bool,
        can: &CanStatistics,
    ) -> Self {
        match &bus.protocol {
            Protocol::ModbusRtu(modbus) | Protocol::ModbusAscii(modbus) => {
                Bus::Modbus(Modbus::new(bus, modbus, statistics))
            }
            Protocol::Framed(framed) => Bus::Framed(Framed::new(bus, framed, cycles, line_down)),
            Protocol::Canopen(canopen) => Bus::Canopen(Canopen::new(bus, canopen, can)),
        }
    }
}

impl<'a> Canopen<'a> {
    fn new(bus: &'a settings::Bus, canopen: &settings::Canopen, counted: &CanStatistics) -> Self {
        Self {
            name: &bus.name,
            protocol: bus.protocol.name(),
            port: &bus.port,
            bitrate: canopen.bitrate,
            node: canopen.node,
            net: canopen.net,
            sync_us: canopen.sync_us,
            sync_overflow: canopen.sync_overflow,
            heartbeat_ms: canopen.heartbeat_ms,
            sdo_timeout_ms: canopen.sdo_timeout_ms,
            client_frames: canopen.client_frames,
            statistics: Frames::new(counted),
        }
    }
}

impl<'a> Framed<'a> {
    fn new(
        bus: &'a settings::Bus,
        framed: &settings::Framed,
        cycles: &master::Statistics,
        line_down: bool,
    ) -> Self {
        Self {
            name: &bus.name,
            protocol: bus.protocol.name(),
            port: &bus.port,
            baud: framed.line.baud,
            format: Text(framed.line.format),
            station: framed.station,
            policy: framed.policy,
            cycle_ms: framed.cycle_ms,
            ipg: framed.ipg,
            slot: framed.slot,
            attempts: framed.attempts,
            window: framed.window,
            echo: framed.echo,
            statistics: Cycles {
                cycles: cycles.cycles,
                failed: cycles.failed,
                overruns: cycles.overruns,
                missed: cycles.missed,
                last_cycle_us: micros(cycles.last_cycle),
                longest_cycle_us: micros(cycles.longest_cycle),
                line_down,
                failure: cycles.failure.map(Text),
                line: Arbiter {
                    frames: cycles.line.frames,
                    attempts: cycles.line.attempts,
                    collisions: cycles.line.collisions,
                    deferrals: cycles.line.deferrals,
                    backoff_us: micros(cycles.line.backoff),
                    losses: cycles.line.losses,
                },
            },
        }
    }
}

impl<'a> Modbus<'a> {
    fn new(bus: &'a settings::Bus, modbus: &settings::Modbus, statistics: &Statistics) -> Self {
        Self {
            name: &bus.name,
            protocol: bus.protocol.name(),
            port: &bus.port,
            baud: modbus.line.baud,
            format: Text(modbus.line.format),
            units: Text(modbus.units),
            reply_timeout_ms: modbus.reply_timeout_ms,
            turnaround_ms: modbus.turnaround_ms,
            rest_ms: modbus.rest_ms,
            quarantine_ms: modbus.quarantine_ms.unwrap_or(modbus.reply_timeout_ms),
            queue_timeout_ms: modbus.queue_timeout_ms,
            echo: modbus.echo,
            statistics: Counted::new(statistics),
        }
    }
}

impl Counted {
    pub(super) fn new(statistics: &Statistics) -> Self {
        Self {
            submitted: statistics.submitted,
            confirmed: statistics.confirmed,
            exceptions: statistics.exceptions,
            broadcasts: statistics.broadcasts,
            no_reply: statistics.no_reply,
            expired: statistics.expired,
            rested: statistics.rested,
            stopped: statistics.stopped,
            line_down: statistics.line_down,
            queue_full: statistics.queue_full,
            waiting: statistics.waiting,
            resting: statistics.resting,
            latency_mean_us: statistics.latency_sum_us.checked_div(u64::from(statistics.confirmed)),
            line: Line::new(&statistics.line),
        }
    }
}

impl Line {
    const fn new(counters: &Counters) -> Self {
        let Counters { requests, replies, exceptions, timeouts, check_errors, wrong_unit, .. } = *counters;
        let Counters { wrong_function, wrong_length, late, echoes, garbage_bytes, line_errors, .. } =
            *counters;
        Self {
            requests,
            replies,
            exceptions,
            timeouts,
            check_errors,
            wrong_unit,
            wrong_function,
            wrong_length,
            late,
            echoes,
            garbage_bytes,
            line_errors,
        }
    }
}
