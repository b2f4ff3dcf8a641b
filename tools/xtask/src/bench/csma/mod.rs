//! CSMA/CD on a simulated line: throughput under saturation against Metcalfe and Boggs, delay and fairness under load.
//!
//! All times are virtual, so that every machine measures the same.

mod case;
mod chart;
mod page;
mod station;

use std::time::Duration;

use puente_framed::arbiter::{Config, Policy};
use puente_line::Settings;

use crate::Outcome;
use crate::command::root;
use case::{Case, Figures, frame_bits, measure};

/// Time on the line of each case.
const TIME: Duration = Duration::from_secs(20);
/// Least part of the Metcalfe-Boggs value, in percent.
const LEAST: f64 = 95.0;
const STATIONS: [usize; 5] = [2, 3, 5, 10, 32];
/// Bytes of the shortest frame of the thesis, of one axis' full section, of three, and of the longest frame.
const LENGTHS: [usize; 4] = [51, 261, 771, 1536];
/// Stations and bytes under offered load.
const LOADED: (usize, [usize; 2]) = (10, [51, 771]);
const POLICIES: [Policy; 2] = [Policy::Truncated, Policy::Thesis];

/// A row of the page: both policies, in the order of [`POLICIES`].
struct Row {
    stations: usize,
    length: usize,
    /// Bits offered per bit of the line; none for saturation.
    offered: Option<f64>,
    figures: [Figures; 2],
}

/// The rows of one configuration.
struct Table {
    config: Config,
    rows: Vec<Row>,
}

pub fn run() -> Outcome {
    let line = Settings { baud: 1_000_000, format: "8N1".parse().map_err(|error| format!("{error}"))? };
    let ours = Config::new(line);
    // Ethernet's slot and gap, in bits, no deference and no rest.
    let slot = Duration::from_micros(512);
    let ethernet = Config {
        gap: Duration::from_micros(96),
        deference: Duration::ZERO,
        slot,
        rest: Duration::ZERO,
        ..ours
    };
    let saturated = [saturated(ours)?, saturated(ethernet)?];
    let loaded = loaded(ours)?;
    let chart = root().join("docs/csma.svg");
    std::fs::write(&chart, page::chart(&saturated[0], &loaded))
        .map_err(|error| format!("{}: {error}", chart.display()))?;
    println!("{}", page::page(&saturated, &loaded));
    let missed = |table: &Table| table.rows.iter().filter(|row| worst(table.config, row) < LEAST).count();
    match saturated.iter().map(missed).sum() {
        0 => Ok(()),
        missed => Err(format!("{missed} rows are below {LEAST} % of the Metcalfe-Boggs value")),
    }
}

fn saturated(config: Config) -> Result<Table, String> {
    let cases = LENGTHS.into_iter().flat_map(|length| STATIONS.map(|stations| (stations, length, None)));
    table(config, cases)
}

fn loaded(config: Config) -> Result<Table, String> {
    let (stations, lengths) = LOADED;
    let loads = (1..=20).map(|tenth| f64::from(tenth) / 10.0);
    let cases =
        lengths.into_iter().flat_map(|length| loads.clone().map(move |load| (stations, length, Some(load))));
    table(config, cases)
}

fn table(config: Config, cases: impl Iterator<Item = (usize, usize, Option<f64>)>) -> Result<Table, String> {
    let mut rows = Vec::new();
    for (stations, length, offered) in cases {
        eprintln!(
            "{stations} stations, {length} bytes, {}",
            offered.map_or("saturated".into(), |load| format!("{load:.1}"))
        );
        let one = |policy| measure(config, Case { policy, stations, length, offered }, TIME);
        let [truncated, thesis] = POLICIES.map(one);
        rows.push(Row { stations, length, offered, figures: [truncated?, thesis?] });
    }
    Ok(Table { config, rows })
}

/// Metcalfe's and Boggs' efficiency of `stations` that all have something to say: E = P / (P + W T), with P the bits of a
/// frame, T those of a slot, W = (1 - A) / A slots of contention, A = (1 - 1/Q)^(Q-1).
fn metcalfe_boggs(config: Config, stations: usize, length: usize) -> f64 {
    let q = stations as f64;
    let a = (1.0 - 1.0 / q).powf(q - 1.0);
    let frame = frame_bits(config.line, length);
    let slot = config.slot.as_secs_f64() * f64::from(config.line.baud);
    frame / (frame + (1.0 - a) / a * slot)
}

/// Percent of the Metcalfe-Boggs value that the worse of the policies reaches.
fn worst(config: Config, row: &Row) -> f64 {
    let value = metcalfe_boggs(config, row.stations, row.length);
    row.figures.iter().map(|figures| figures.throughput / value * 100.0).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values computed apart from this, for slots of 512 bits.
    #[test]
    fn metcalfe_boggs_is_theirs() {
        let line = Settings { baud: 1_000_000, format: "8N1".parse().expect("format") };
        let config = Config { slot: Duration::from_micros(5_120), ..Config::new(line) };
        // 512 characters of 10 bits, as the slot; then eight times as many.
        for (stations, length, value) in [(2, 512, 0.5), (3, 512, 0.444), (32, 512, 0.374), (5, 4096, 0.847)]
        {
            let found = metcalfe_boggs(config, stations, length);
            assert!((found - value).abs() < 0.000_6, "{stations}, {length}: {found}");
        }
    }
}
