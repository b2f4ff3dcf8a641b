//! What is measured of framed buses.

use embedded_io_async::Write;
use puente_modules::master::Statistics;

use super::super::super::{End, Gateway};
use super::super::reply::Reply;
use super::{Count, Seconds, events, family};

/// What became of cycles.
const CYCLES: [Count<Statistics>; 4] = [
    ("done", |counted| counted.cycles),
    ("given-up", |counted| counted.failed),
    ("overrun", |counted| counted.overruns),
    ("report-missed", |counted| counted.missed),
];

/// What happened on a line.
const LINE: [Count<Statistics>; 5] = [
    ("frame", |counted| counted.line.frames),
    ("attempt", |counted| counted.line.attempts),
    ("collision", |counted| counted.line.collisions),
    ("deferral", |counted| counted.line.deferrals),
    ("loss", |counted| counted.line.losses),
];

type Time = (&'static str, &'static str, &'static str, fn(&Statistics) -> puente_line::Duration);

const TIMES: [Time; 3] = [
    ("puente_cycle_seconds", "gauge", "From one cyclic frame to the next, the last.", |counted| {
        counted.last_cycle
    }),
    ("puente_cycle_longest_seconds", "gauge", "The longest of these.", |counted| counted.longest_cycle),
    ("puente_csma_backoff_seconds_total", "counter", "All back-offs together.", |counted| {
        counted.line.backoff
    }),
];

/// Every framed bus with its name and statistics.
fn counted(gateway: &Gateway) -> impl Iterator<Item = (&str, Statistics)> {
    let cycles = |index| gateway.desk.cycles(index).unwrap_or_default();
    let framed = (0..).zip(&gateway.settings.buses).filter(|(_, bus)| bus.framed().is_some());
    framed.map(move |(index, bus)| (bus.name.as_str(), cycles(index)))
}

/// Sends all of it; nothing where there is no framed bus.
pub(super) async fn send<W: Write>(gateway: &Gateway, reply: &mut Reply<'_, W>) -> Result<(), End> {
    if counted(gateway).next().is_none() {
        return Ok(());
    }
    const BECAME: &str = "Cycles of a framed bus, by what became of them.";
    events(reply, "puente_cycles_total", BECAME, counted(gateway), &CYCLES).await?;
    const MET: &str = "What the station met on the line.";
    events(reply, "puente_csma_events_total", MET, counted(gateway), &LINE).await?;
    for (name, kind, help, value) in TIMES {
        family(reply, name, kind, help).await?;
        for (bus, counted) in counted(gateway) {
            let time = Seconds::of(value(&counted));
            reply.put(format_args!("{name}{{bus=\"{bus}\"}} {time}\n")).await?;
        }
    }
    Ok(())
}
