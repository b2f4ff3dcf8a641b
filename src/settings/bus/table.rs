//! A bus as a document has it.

use heapless::String;
use puente_line::{Format, Settings as Line};
use serde::Deserialize;

use super::{Bus, Canopen, ClientFrames, Echo, Framed, Kind, Modbus, Name, Policy, Protocol, Text};
use crate::desk::Units;

/// A bus as a document has it, with the keys of every protocol.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Table {
    name: Name,
    protocol: Kind,
    port: String<64>,
    baud: Option<u32>,
    format: Option<Text<Format>>,
    units: Option<Text<Units>>,
    reply_timeout_ms: Option<u32>,
    turnaround_ms: Option<u32>,
    rest_ms: Option<u32>,
    quarantine_ms: Option<u32>,
    queue_timeout_ms: Option<u32>,
    echo: Option<Echo>,
    station: Option<u8>,
    policy: Option<Policy>,
    cycle_ms: Option<u16>,
    ipg: Option<u16>,
    slot: Option<u16>,
    attempts: Option<u8>,
    window: Option<u8>,
    bitrate: Option<u32>,
    node: Option<u8>,
    net: Option<u16>,
    sync_us: Option<u32>,
    sync_overflow: Option<u8>,
    heartbeat_ms: Option<u16>,
    sdo_timeout_ms: Option<u16>,
    client_frames: Option<ClientFrames>,
}

pub(super) const KEYS: &[&str] = &[
    "name",
    "protocol",
    "port",
    "baud",
    "format",
    "units",
    "reply_timeout_ms",
    "turnaround_ms",
    "rest_ms",
    "quarantine_ms",
    "queue_timeout_ms",
    "echo",
    "station",
    "policy",
    "cycle_ms",
    "ipg",
    "slot",
    "attempts",
    "window",
    "bitrate",
    "node",
    "net",
    "sync_us",
    "sync_overflow",
    "heartbeat_ms",
    "sdo_timeout_ms",
    "client_frames",
];

impl Table {
    fn line(&self, usual: Line) -> Line {
        Line {
            baud: self.baud.unwrap_or(usual.baud),
            format: self.format.as_ref().map_or(usual.format, |text| text.0),
        }
    }

    fn modbus(&self) -> Modbus {
        let usual = Modbus::default();
        Modbus {
            line: self.line(usual.line),
            units: self.units.as_ref().map_or(usual.units, |text| text.0),
            reply_timeout_ms: self.reply_timeout_ms.unwrap_or(usual.reply_timeout_ms),
            turnaround_ms: self.turnaround_ms.unwrap_or(usual.turnaround_ms),
            rest_ms: self.rest_ms.unwrap_or(usual.rest_ms),
            quarantine_ms: self.quarantine_ms,
            queue_timeout_ms: self.queue_timeout_ms.unwrap_or(usual.queue_timeout_ms),
            echo: self.echo.unwrap_or(usual.echo),
        }
    }

    fn framed(&self) -> Framed {
        let usual = Framed::default();
        Framed {
            line: self.line(usual.line),
            station: self.station.unwrap_or(usual.station),
            policy: self.policy.unwrap_or(usual.policy),
            cycle_ms: self.cycle_ms.unwrap_or(usual.cycle_ms),
            ipg: self.ipg.unwrap_or(usual.ipg),
            slot: self.slot.unwrap_or(usual.slot),
            attempts: self.attempts.unwrap_or(usual.attempts),
            window: self.window.unwrap_or(usual.window),
            echo: self.echo.unwrap_or(usual.echo),
        }
    }

    fn canopen(&self) -> Canopen {
        let usual = Canopen::default();
        Canopen {
            bitrate: self.bitrate.unwrap_or(usual.bitrate),
            node: self.node.unwrap_or(usual.node),
            net: self.net.unwrap_or(usual.net),
            sync_us: self.sync_us.unwrap_or(usual.sync_us),
            sync_overflow: self.sync_overflow.unwrap_or(usual.sync_overflow),
            heartbeat_ms: self.heartbeat_ms.unwrap_or(usual.heartbeat_ms),
            sdo_timeout_ms: self.sdo_timeout_ms.unwrap_or(usual.sdo_timeout_ms),
            client_frames: self.client_frames.unwrap_or(usual.client_frames),
        }
    }

    /// The first key that is given and that only other protocols have.
    fn stray(&self) -> Option<&'static str> {
        let serial =
            [("baud", self.baud.is_some()), ("format", self.format.is_some()), ("echo", self.echo.is_some())];
        let modbus = [
            ("units", self.units.is_some()),
            ("reply_timeout_ms", self.reply_timeout_ms.is_some()),
            ("turnaround_ms", self.turnaround_ms.is_some()),
            ("rest_ms", self.rest_ms.is_some()),
            ("quarantine_ms", self.quarantine_ms.is_some()),
            ("queue_timeout_ms", self.queue_timeout_ms.is_some()),
        ];
        let framed = [
            ("station", self.station.is_some()),
            ("policy", self.policy.is_some()),
            ("cycle_ms", self.cycle_ms.is_some()),
            ("ipg", self.ipg.is_some()),
            ("slot", self.slot.is_some()),
            ("attempts", self.attempts.is_some()),
            ("window", self.window.is_some()),
        ];
        let canopen = [
            ("bitrate", self.bitrate.is_some()),
            ("node", self.node.is_some()),
            ("net", self.net.is_some()),
            ("sync_us", self.sync_us.is_some()),
            ("sync_overflow", self.sync_overflow.is_some()),
            ("heartbeat_ms", self.heartbeat_ms.is_some()),
            ("sdo_timeout_ms", self.sdo_timeout_ms.is_some()),
            ("client_frames", self.client_frames.is_some()),
        ];
        let others: &[&[_]] = match self.protocol {
            Kind::ModbusRtu | Kind::ModbusAscii => &[&framed, &canopen],
            Kind::Framed => &[&modbus, &canopen],
            Kind::Canopen => &[&serial, &modbus, &framed],
        };
        others.iter().copied().flatten().find(|(_, given)| *given).map(|(key, _)| *key)
    }
}

impl From<Table> for Bus {
    fn from(table: Table) -> Self {
        Self {
            protocol: match table.protocol {
                Kind::ModbusRtu => Protocol::ModbusRtu(table.modbus()),
                Kind::ModbusAscii => Protocol::ModbusAscii(table.modbus()),
                Kind::Framed => Protocol::Framed(table.framed()),
                Kind::Canopen => Protocol::Canopen(table.canopen()),
            },
            stray: table.stray(),
            name: table.name,
            port: table.port,
        }
    }
}
