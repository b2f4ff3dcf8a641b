//! What is measured, as text for Prometheus (exposition format 0.0.4).

mod axes;
mod can;
mod cyclic;

use core::fmt;

use embedded_io_async::Write;
use puente_modbus::Counters;

use super::super::{End, Gateway};
use super::reply::Reply;
use crate::clock;
use crate::desk::{BUCKETS_MS, Statistics};

const CONTENT_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

type Count<T> = (&'static str, fn(&T) -> u32);

/// How a request of a client ended.
const OUTCOMES: [Count<Statistics>; 8] = [
    ("confirmed", |statistics| statistics.confirmed),
    ("broadcast", |statistics| statistics.broadcasts),
    ("no-reply", |statistics| statistics.no_reply),
    ("expired", |statistics| statistics.expired),
    ("resting", |statistics| statistics.rested),
    ("stopped", |statistics| statistics.stopped),
    ("line-down", |statistics| statistics.line_down),
    ("queue-full", |statistics| statistics.queue_full),
];

/// What happened on a line.
const LINE: [Count<Counters>; 12] = [
    ("request", |line| line.requests),
    ("reply", |line| line.replies),
    ("exception", |line| line.exceptions),
    ("timeout", |line| line.timeouts),
    ("check-error", |line| line.check_errors),
    ("wrong-unit", |line| line.wrong_unit),
    ("wrong-function", |line| line.wrong_function),
    ("wrong-length", |line| line.wrong_length),
    ("late", |line| line.late),
    ("echo", |line| line.echoes),
    ("garbage-byte", |line| line.garbage_bytes),
    ("line-error", |line| line.line_errors),
];

/// Sends all of it.
pub(super) async fn send<W: Write>(gateway: &Gateway, reply: &mut Reply<'_, W>) -> Result<(), End> {
    reply.content_type(CONTENT_TYPE);
    own(gateway, reply).await?;
    buses(gateway, reply).await?;
    latency(gateway, reply).await?;
    cyclic::send(gateway, reply).await?;
    can::send(gateway, reply).await?;
    packets(gateway, reply).await?;
    axes::send(gateway, reply).await?;
    reply.finish().await
}

async fn family<W: Write>(reply: &mut Reply<'_, W>, name: &str, kind: &str, help: &str) -> Result<(), End> {
    reply.put(format_args!("# HELP {name} {help}\n# TYPE {name} {kind}\n")).await
}

/// What was counted of events on several buses.
async fn events<'b, T, W: Write>(
    reply: &mut Reply<'_, W>,
    name: &str,
    help: &str,
    buses: impl Iterator<Item = (&'b str, T)>,
    counts: &[Count<T>],
) -> Result<(), End> {
    family(reply, name, "counter", help).await?;
    for (bus, counted) in buses {
        for (event, count) in counts {
            let count = count(&counted);
            reply.put(format_args!("{name}{{bus=\"{bus}\",event=\"{event}\"}} {count}\n")).await?;
        }
    }
    Ok(())
}

async fn single<W: Write>(
    reply: &mut Reply<'_, W>,
    name: &str,
    kind: &str,
    help: &str,
    value: impl fmt::Display,
) -> Result<(), End> {
    family(reply, name, kind, help).await?;
    reply.put(format_args!("{name} {value}\n")).await
}

async fn own<W: Write>(gateway: &Gateway, reply: &mut Reply<'_, W>) -> Result<(), End> {
    let (clients, connections) = gateway.clients();
    let (used, places) = gateway.desk.tickets();
    let uptime = Seconds::of(clock::now().since(gateway.started));
    family(reply, "puente_info", "gauge", "Version of the gateway.").await?;
    reply.put(format_args!("puente_info{{version=\"{}\"}} 1\n", env!("CARGO_PKG_VERSION"))).await?;
    single(reply, "puente_uptime_seconds", "gauge", "Time since the start.", uptime).await?;
    single(reply, "puente_clients", "gauge", "Connections open.", clients).await?;
    single(reply, "puente_connections_total", "counter", "Connections accepted.", connections).await?;
    single(reply, "puente_queue_used", "gauge", "Requests under way, of all clients.", used).await?;
    single(reply, "puente_queue_places", "gauge", "Requests that can be under way at once.", places).await
}

/// Clients' packets, where there is a framed bus.
async fn packets<W: Write>(gateway: &Gateway, reply: &mut Reply<'_, W>) -> Result<(), End> {
    if gateway.desk.framed_bus().is_none() {
        return Ok(());
    }
    let packets = gateway.desk.mail_statistics();
    let counts = [
        ("sent", packets.sent),
        ("refused", packets.undelivered),
        ("heard", packets.heard),
        ("lost", packets.lost),
    ];
    family(reply, "puente_packets_total", "counter", "Packets of clients on the framed bus.").await?;
    for (what, count) in counts {
        reply.put(format_args!("puente_packets_total{{what=\"{what}\"}} {count}\n")).await?;
    }
    Ok(())
}

/// Every Modbus bus with its name and statistics.
fn counted(gateway: &Gateway) -> impl Iterator<Item = (&str, Statistics)> {
    let statistics = |index| gateway.desk.statistics(index).unwrap_or_default();
    let modbus = (0..).zip(&gateway.settings.buses).filter(|(_, bus)| bus.modbus().is_some());
    modbus.map(move |(index, bus)| (bus.name.as_str(), statistics(index)))
}

async fn buses<W: Write>(gateway: &Gateway, reply: &mut Reply<'_, W>) -> Result<(), End> {
    family(reply, "puente_bus_requests_total", "counter", "Requests of clients, by how they ended.").await?;
    for (bus, statistics) in counted(gateway) {
        for (outcome, count) in OUTCOMES {
            let count = count(&statistics);
            reply
                .put(format_args!(
                    "puente_bus_requests_total{{bus=\"{bus}\",outcome=\"{outcome}\"}} {count}\n"
                ))
                .await?;
        }
    }
    family(
        reply,
        "puente_bus_exceptions_total",
        "counter",
        "Confirmed requests whose reply was an exception.",
    )
    .await?;
    for (bus, statistics) in counted(gateway) {
        reply
            .put(format_args!("puente_bus_exceptions_total{{bus=\"{bus}\"}} {}\n", statistics.exceptions))
            .await?;
    }
    family(reply, "puente_bus_waiting", "gauge", "Requests that wait for their turn.").await?;
    for (bus, statistics) in counted(gateway) {
        reply.put(format_args!("puente_bus_waiting{{bus=\"{bus}\"}} {}\n", statistics.waiting)).await?;
    }
    family(reply, "puente_bus_resting", "gauge", "Slaves that do not answer and are left alone for a while.")
        .await?;
    for (bus, statistics) in counted(gateway) {
        reply.put(format_args!("puente_bus_resting{{bus=\"{bus}\"}} {}\n", statistics.resting)).await?;
    }
    family(reply, "puente_line_events_total", "counter", "What the master saw on the line.").await?;
    for (bus, statistics) in counted(gateway) {
        for (event, count) in LINE {
            let count = count(&statistics.line);
            reply
                .put(format_args!("puente_line_events_total{{bus=\"{bus}\",event=\"{event}\"}} {count}\n"))
                .await?;
        }
    }
    Ok(())
}

async fn latency<W: Write>(gateway: &Gateway, reply: &mut Reply<'_, W>) -> Result<(), End> {
    const NAME: &str = "puente_bus_latency_seconds";
    family(reply, NAME, "histogram", "From queueing to reply, of confirmed requests.").await?;
    for (bus, statistics) in counted(gateway) {
        let mut sum = 0;
        for (bound, count) in BUCKETS_MS.iter().zip(&statistics.latency) {
            sum += count;
            let bound = Seconds { micros: u64::from(*bound) * 1000 };
            reply.put(format_args!("{NAME}_bucket{{bus=\"{bus}\",le=\"{bound}\"}} {sum}\n")).await?;
        }
        let Statistics { confirmed, latency_sum_us, .. } = statistics;
        let total = Seconds { micros: latency_sum_us };
        reply.put(format_args!("{NAME}_bucket{{bus=\"{bus}\",le=\"+Inf\"}} {confirmed}\n")).await?;
        reply.put(format_args!("{NAME}_sum{{bus=\"{bus}\"}} {total}\n")).await?;
        reply.put(format_args!("{NAME}_count{{bus=\"{bus}\"}} {confirmed}\n")).await?;
    }
    Ok(())
}

/// A time in seconds, written without trailing zeros.
struct Seconds {
    micros: u64,
}

impl Seconds {
    fn of(duration: puente_line::Duration) -> Self {
        Self { micros: puente_line::micros(duration) }
    }
}

impl fmt::Display for Seconds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.micros / 1_000_000)?;
        let (mut rest, mut digits) = (self.micros % 1_000_000, 6);
        if rest == 0 {
            return Ok(());
        }
        while rest % 10 == 0 {
            rest /= 10;
            digits -= 1;
        }
        write!(f, ".{rest:0digits$}")
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;

    use super::*;

    #[test]
    fn seconds() {
        for (micros, text) in [
            (0, "0"),
            (1, "0.000001"),
            (5_000, "0.005"),
            (10_000, "0.01"),
            (500_000, "0.5"),
            (2_000_000, "2"),
            (61_046_830, "61.04683"),
        ] {
            assert_eq!(Seconds { micros }.to_string(), text);
        }
    }
}
