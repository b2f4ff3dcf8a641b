//! Read Holding Registers through the gateway, on a paced line against the floor of its wire time, and unpaced.

use std::time::Duration;

use puente_line::Settings;
use puente_modbus::rtu;

use super::client::{self, Seen};
use super::programs::{Bench, Cell, Gateway};
use super::samples::{Samples, ms};
use super::{client::reply_adu, machine};
use crate::Outcome;
use crate::command::{cargo, run as run_command, target_dir};

/// Each case is measured this often, with the others in between, lest a disturbance meets one case alone.
const ROUNDS: usize = 3;
const PACED: Duration = Duration::from_secs(4);
const UNPACED: Duration = Duration::from_secs(2);
/// How far the median transaction may be above the floor, in percent.
const ALLOWED: f64 = 5.0;

pub fn run() -> Outcome {
    let bench = build()?;
    let line = Settings { baud: 115_200, format: "8E1".parse().map_err(|error| format!("{error}"))? };
    let before = machine::description();
    let paced = paced(&bench, line)?;
    let unpaced = unpaced(&bench)?;
    println!("{}", page(line, &before, &paced, &unpaced));
    let missed = paced.iter().filter(|case| case.clients > 0 && case.above_floor() > ALLOWED).count();
    if missed == 0 {
        Ok(())
    } else {
        Err(format!("{missed} cases are more than {ALLOWED} % above the floor"))
    }
}

pub fn build() -> Result<Bench, String> {
    let packages = ["--package", "puente", "--package", "cell"];
    run_command(cargo().args(["build", "--release", "--quiet", "--bins"]).args(packages))?;
    let target = target_dir()?;
    let scratch = target.join("bench");
    std::fs::create_dir_all(&scratch).map_err(|error| format!("{}: {error}", scratch.display()))?;
    Ok(Bench { programs: target.join("release"), scratch })
}

/// A case on the paced line; without clients it is the bare line.
struct Paced {
    quantity: u16,
    clients: usize,
    floor: Duration,
    transactions: Samples,
    latencies: Option<Samples>,
}

impl Paced {
    /// Percent.
    fn above_floor(&self) -> f64 {
        (self.transactions.median().as_secs_f64() / self.floor.as_secs_f64() - 1.0) * 100.0
    }
}

fn paced(bench: &Bench, line: Settings) -> Result<Vec<Paced>, String> {
    let cases = [(1, 0), (1, 1), (1, 32), (125, 0), (125, 1), (125, 32)];
    let mut found = cases.map(|_| (Vec::new(), Vec::new()));
    for round in 1..=ROUNDS {
        for ((quantity, clients), (transactions, latencies)) in cases.iter().zip(&mut found) {
            eprintln!("round {round} of {ROUNDS}: paced, {quantity} registers, {clients} clients");
            let cell = Cell::start(bench, true)?;
            if *clients == 0 {
                client::at_line(&cell.line, line, *quantity, PACED)?;
            } else {
                latencies.extend(through(bench, &cell, *clients, *quantity, PACED)?.latencies);
            }
            let replies = cell.replies(reply_adu(*quantity))?;
            transactions.extend(replies.windows(2).map(|pair| pair[1] - pair[0]));
        }
    }
    let case = |((quantity, clients), (transactions, latencies)): ((u16, usize), (_, Vec<_>))| {
        Ok(Paced {
            quantity,
            clients,
            floor: floor(line, quantity),
            transactions: Samples::new(transactions)?,
            latencies: if latencies.is_empty() { None } else { Some(Samples::new(latencies)?) },
        })
    };
    cases.into_iter().zip(found).map(case).collect()
}

/// Request and reply on the wire, and t3.5 before each.
fn floor(line: Settings, quantity: u16) -> Duration {
    let request = rtu::emit(1, &client::request(quantity).emit()).len();
    line.wire_time(request + reply_adu(quantity)) + 2 * rtu::t3_5(line)
}

/// A case on the unpaced line.
struct Unpaced {
    clients: usize,
    per_second: f64,
    latencies: Samples,
}

fn unpaced(bench: &Bench) -> Result<Vec<Unpaced>, String> {
    let cases = [1, 4, 16, 32];
    let mut found = cases.map(|_| Seen { latencies: Vec::new(), time: Duration::ZERO });
    for round in 1..=ROUNDS {
        for (clients, sum) in cases.iter().zip(&mut found) {
            eprintln!("round {round} of {ROUNDS}: unpaced, 1 register, {clients} clients");
            let cell = Cell::start(bench, false)?;
            let seen = through(bench, &cell, *clients, 1, UNPACED)?;
            sum.latencies.extend(seen.latencies);
            sum.time += seen.time;
        }
    }
    let case = |(clients, seen): (usize, Seen)| {
        Ok(Unpaced {
            clients,
            per_second: seen.latencies.len() as f64 / seen.time.as_secs_f64(),
            latencies: Samples::new(seen.latencies)?,
        })
    };
    cases.into_iter().zip(found).map(case).collect()
}

fn through(
    bench: &Bench,
    cell: &Cell,
    clients: usize,
    quantity: u16,
    time: Duration,
) -> Result<Seen, String> {
    let gateway = Gateway::start(bench, &cell.line)?;
    client::over_tcp(gateway.address, clients, quantity, time)
}

fn page(line: Settings, machine: &str, paced: &[Paced], unpaced: &[Unpaced]) -> String {
    let silence = rtu::t3_5(line);
    let mut page = format!(
        "# Measurements\n\n\
         `cargo xtask bench modbus > docs/bench.md`\n\n\
         On {machine} at the start, {} at the end.\n\n\
         Read Holding Registers through the Modbus/TCP port to one simulated slave on a pseudo terminal, RTU at {} {}.\n\
         Every client sends its next request when it has the reply. All times in ms; {ROUNDS} rounds of every case in\n\
         turn.\n\n\
         ## Paced line\n\n\
         The slave models the time on the wire of request and reply, and keeps t3.5 before the reply. The floor is the\n\
         wire time of both frames and two t3.5. *Transaction* is the time from the end of a reply on the line to the\n\
         end of the next, by the slave's clock; *latency* is what a client sees, which with 32 clients is mostly its\n\
         place in the queue. *Line alone* is a loop at the pseudo terminal without a gateway: what it is above the\n\
         floor, the system's timers, pseudo terminal and scheduler cost.\n\n\
         | registers | clients | floor | transaction p50 | above floor | p99 | latency p50 | p99 | transactions |\n\
         |--:|--:|--:|--:|--:|--:|--:|--:|--:|\n",
        machine::load(),
        line.baud,
        line.format,
    );
    for case in paced {
        page += &row(&[
            case.quantity.to_string(),
            if case.clients == 0 { "line alone".into() } else { case.clients.to_string() },
            ms(case.floor),
            ms(case.transactions.median()),
            format!("{:.1} %", case.above_floor()),
            ms(case.transactions.percentile(99)),
            case.latencies.as_ref().map_or(String::new(), |seen| ms(seen.median())),
            case.latencies.as_ref().map_or(String::new(), |seen| ms(seen.percentile(99))),
            case.transactions.count().to_string(),
        ]);
    }
    page += &format!(
        "\n## Unpaced line\n\n\
         Characters take no time and the slave answers at once, so that the t3.5 of {} ms before each request is all\n\
         that is left of the floor: at most {:.0} requests a second.\n\n\
         | clients | floor | requests/s | latency p50 | p99 | requests |\n\
         |--:|--:|--:|--:|--:|--:|\n",
        ms(silence),
        1.0 / silence.as_secs_f64(),
    );
    for case in unpaced {
        page += &row(&[
            case.clients.to_string(),
            ms(silence),
            format!("{:.0}", case.per_second),
            ms(case.latencies.median()),
            ms(case.latencies.percentile(99)),
            case.latencies.count().to_string(),
        ]);
    }
    page.trim_end().to_owned()
}

pub fn row(cells: &[String]) -> String {
    format!("| {} |\n", cells.join(" | "))
}
