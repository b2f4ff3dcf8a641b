//! The page and its chart.

use std::time::Duration;

use puente_shared_line::talker::QUEUE;

use super::case::{Figures, SHORT, frame_bits};
use super::chart::{self, Axis, Curve, Plot};
use super::{LEAST, LENGTHS, LOADED, Row, STATIONS, TIME, Table, metcalfe_boggs};
use crate::bench::samples::ms;

const BLUE: &str = "#1f5fa8";
const RED: &str = "#b8402a";
const GREY: &str = "#777777";

pub fn page(saturated: &[Table; 2], loaded: &Table) -> String {
    let [ours, ethernet] = saturated;
    let line = ours.config.line;
    format!(
        "# CSMA/CD measured\n\n\
         `cargo xtask bench csma > docs/csma.md` (writes `docs/csma.svg` too)\n\n\
         The arbiter of `protocols/framed` on the simulated line of `tools/shared-line`: {} baud {}, a cable of 500 ns,\n\
         transceivers that turn around in 1 to 2 bit times, stations that notice a start bit. Times are virtual, {} s a\n\
         case, the same on every machine. The line stops the run when a station breaks a rule, and a listener must\n\
         understand as many frames as were sent. Two policies: *truncated* binary exponential back-off (the default) and\n\
         that of the *thesis*.\n\n\
         ![throughput and delay](csma.svg)\n\n\
         ## Saturation\n\n\
         Every station always has another frame. Throughput is the part of the time in which whole frames are on the line;\n\
         gaps are not. *M-B* is the value of Metcalfe and Boggs for the same slot T and frame of P bits,\n\
         E = P / (P + W T), W = (1 - A) / A, A = (1 - 1/Q)^(Q-1): the form that goes to 1/(1 + 3.44 a) for many stations,\n\
         with T for the round trip 2 tau. It knows no gaps. At least {LEAST} % are asked for.\n\n\
         Values above 100 % are no error: M-B gives every station the same chance in every slot, while here stations that\n\
         have met wait for whole frames of others, out of the way (the capture effect). In IEEE 802.3 one station takes the\n\
         line so; with the rest of a slot after each frame, which is our default, it is two or more in turn, and two share it\n\
         evenly. *Fairness* is Jain's index over the whole run and over {SHORT} frames a station. *Given up* are frames that\n\
         collided 16 times in a row, which is reported; windows repeat them. The longer frames are in slots, the more are\n\
         given up, since all who wait for the end of a frame begin at once.\n\n\
         ### Slot {} us, gap {} us, deference {} us, rest {} us (the default)\n\n{}\n\
         ### Slot {} us, gap {} us, no deference, no rest (IEEE 802.3, in bits)\n\n{}\n\
         ## Offered load\n\n\
         {} stations, frames at random times (Poisson), the default. Load is in percent of the line's bits. *Delay*\n\
         is from the arrival of a frame to its end on the line, in ms; with more than {QUEUE} frames waiting at a station the\n\
         next is *rejected*. For cyclic commands keep the load below 40 %: from there on the slowest frames wait for many\n\
         others.\n\n{}\n\
         ## Nothing lost above the windows\n\n\
         `cargo test --release -p puente-shared-line --test rivals -- --ignored --nocapture` puts 10^9 bits on the line:\n\
         three masters and two modules that all send to each other through windows, one bit in 10^5 wrong at every\n\
         receiver. Every message must arrive once, in order and unchanged. `cargo test` runs a shorter one, and\n\
         `tests/losses.rs` the same without repetition, where every message that is not delivered must be reported.",
        line.baud,
        line.format,
        TIME.as_secs(),
        ours.config.slot.as_micros(),
        ours.config.gap.as_micros(),
        ours.config.deference.as_micros(),
        ours.config.rest.as_micros(),
        saturation(ours),
        ethernet.config.slot.as_micros(),
        ethernet.config.gap.as_micros(),
        saturation(ethernet),
        LOADED.0,
        load(loaded),
    )
}

fn saturation(table: &Table) -> String {
    let mut text = String::from(
        "| frame | stations | M-B | truncated | of M-B | collisions a frame | fairness, short | given up | thesis | of M-B \
         | collisions a frame | fairness, short | given up |\n\
         |--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for row in &table.rows {
        let value = metcalfe_boggs(table.config, row.stations, row.length);
        let each = row.figures.iter().map(|figures| {
            format!(
                "{:.3} | {:.1} % | {:.2} | {:.3}, {:.3} | {:.2} %",
                figures.throughput,
                figures.throughput / value * 100.0,
                figures.collisions_per_frame,
                figures.fairness,
                figures.short_fairness,
                figures.failed * 100.0
            )
        });
        let each: Vec<String> = each.collect();
        text += &format!("| {} | {} | {value:.3} | {} |\n", row.length, row.stations, each.join(" | "));
    }
    text
}

fn load(table: &Table) -> String {
    let mut text = String::from(
        "| frame | load | truncated: carried | delay p50 | p99 | fairness, short | rejected, given up | thesis: carried | \
         delay p50 | p99 | fairness, short | rejected, given up |\n\
         |--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
    );
    for row in &table.rows {
        let each = row.figures.iter().map(|figures| {
            format!(
                "{:.1} % | {} | {} | {:.3}, {:.3} | {:.1} %, {:.2} %",
                figures.throughput * 100.0,
                ms(percentile(figures, 50)),
                ms(percentile(figures, 99)),
                figures.fairness,
                figures.short_fairness,
                figures.rejected * 100.0,
                figures.failed * 100.0
            )
        });
        let each: Vec<String> = each.collect();
        let load = row.offered.unwrap_or_default() * 100.0;
        text += &format!("| {} | {load:.0} % | {} |\n", row.length, each.join(" | "));
    }
    text
}

/// Nearest rank.
fn percentile(figures: &Figures, percent: usize) -> Duration {
    let rank = (figures.delays.len() * percent).div_ceil(100).max(1);
    figures.delays.get(rank - 1).copied().unwrap_or_default()
}

pub fn chart(saturated: &Table, loaded: &Table) -> String {
    chart::draw(&[throughput(saturated), delay(loaded)])
}

fn throughput(table: &Table) -> Plot {
    let of = |length: usize, value: &dyn Fn(&Row) -> f64| -> Vec<(f64, f64)> {
        let rows = table.rows.iter().filter(|row| row.length == length);
        rows.map(|row| (row.stations as f64, value(row))).collect()
    };
    let mut curves = Vec::new();
    for (length, dashed) in [(LENGTHS[0], false), (LENGTHS[2], true)] {
        let bits = frame_bits(table.config.line, length);
        let mut curve = |name: &str, colour, points| {
            curves.push(Curve { name: format!("{name}, frames of {bits} bits"), colour, dashed, points });
        };
        curve("truncated", BLUE, of(length, &|row| row.figures[0].throughput));
        curve("thesis", RED, of(length, &|row| row.figures[1].throughput));
        let value = |row: &Row| metcalfe_boggs(table.config, row.stations, length);
        curve("Metcalfe-Boggs", GREY, of(length, &value));
    }
    let last = STATIONS[STATIONS.len() - 1] as f64;
    Plot {
        title: "Saturation: throughput",
        x: Axis {
            title: "stations",
            from: 2.0,
            to: last,
            marks: &[2.0, 3.0, 5.0, 10.0, 32.0],
            logarithmic: true,
        },
        y: Axis {
            title: "part of the time",
            from: 0.7,
            to: 1.0,
            marks: &[0.7, 0.75, 0.8, 0.85, 0.9, 0.95, 1.0],
            logarithmic: false,
        },
        curves,
    }
}

fn delay(table: &Table) -> Plot {
    let mut curves = Vec::new();
    for (policy, name, colour) in [(0, "truncated", BLUE), (1, "thesis", RED)] {
        for (percent, dashed) in [(50, false), (99, true)] {
            let rows = table.rows.iter().filter(|row| row.length == LOADED.1[0]);
            let point = |row: &Row| {
                let delay = percentile(&row.figures[policy], percent);
                (row.offered.unwrap_or_default() * 100.0, delay.as_secs_f64() * 1e3)
            };
            let name = format!("{name}, {}", if percent == 50 { "median" } else { "99 % at most" });
            curves.push(Curve { name, colour, dashed, points: rows.map(point).collect() });
        }
    }
    Plot {
        title: "10 stations, frames of 510 bits: delay",
        x: Axis {
            title: "offered load, %",
            from: 0.0,
            to: 200.0,
            marks: &[0.0, 50.0, 100.0, 150.0, 200.0],
            logarithmic: false,
        },
        y: Axis {
            title: "ms",
            from: 0.3,
            to: 1_000.0,
            marks: &[1.0, 10.0, 100.0, 1_000.0],
            logarithmic: true,
        },
        curves,
    }
}
