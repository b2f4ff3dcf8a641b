//! `cargo xtask cost`: instructions of the firmware for each transaction, on the emulated board.
//!
//! A count of instructions is the same whatever else the machine has to do, where a time is not. What is measured, and
//! what it tells, is in docs/cost.md.

mod profile;
mod rig;
mod steps;
mod transactions;

use std::thread;
use std::time::{Duration, Instant};

use crate::Outcome;
use crate::command::{Options, output, program};
use crate::docs::{Table, figure, row, value};
use rig::Rig;
use transactions::{ALL, Connection, Transaction};

const TABLE: Table = Table { file: "docs/cost.md", name: "cost" };
/// By so many percent a transaction may cost more than the table says.
const ALLOWED: u64 = 3;
/// A reading of one register may cost at most so many tenths of the plain echo.
const ECHOES: u64 = 25;
const READING: &str = "Modbus/TCP FC3 x 1";
/// How often what costs too much is measured again: whatever disturbs only adds to it.
const SECOND_LOOKS: usize = 3;
/// What the first bytes of a connection cost is not counted.
const WARM_UP: u32 = 3;
/// Until the last acknowledgement is through.
const SETTLE: Duration = Duration::from_millis(60);
/// How often a batch is tried again in which a request was not answered: the line keeps to its times only as well as
/// the scheduler of a busy machine lets it.
const RETRIES: usize = 5;

/// What a transaction costs, in instructions.
struct Cost {
    /// The lower quartile: what disturbs a batch only adds to it.
    quartile: u64,
    least: u64,
    most: u64,
}

pub fn run(arguments: &[String]) -> Outcome {
    let mut options = Options::new(arguments);
    let write = options.flag("--write");
    let profiled = options.value("--profile")?;
    let only_steps = options.flag("--loop");
    options.end()?;
    if profiled.is_none() {
        steps::run(write)?;
    }
    if only_steps {
        return Ok(());
    }
    let rig = Rig::start()?;
    if let Some(name) = profiled {
        let transaction = ALL.iter().find(|transaction| transaction.short == name);
        let names: Vec<_> = ALL.iter().map(|transaction| transaction.short).collect();
        let transaction =
            transaction.ok_or(format!("no transaction {name}; there are {}", names.join(", ")))?;
        return profile::print(&rig, transaction);
    }
    let compiler = rig::compiler()?;
    let made_with = format!("Made with {compiler}, {}.\n", rig::emulator()?);
    let printed = TABLE.read()?;
    let mut table =
        format!("{made_with}\n| transaction | instructions | spread | echoes |\n|---|---|---|---|\n");
    let mut more = Vec::new();
    let (mut echo, mut reading) = (None, None);
    println!("{:<44}{:>9}  {:<17}{:>6}{:>9}", "transaction", "counts", "spread", "echoes", "before");
    for transaction in ALL {
        let before = row(&printed, transaction.name).and_then(|cells| value(cells.first()?));
        let Cost { quartile, least, most } = look(&rig, transaction, before)?;
        if transaction.name == READING {
            reading = Some(quartile);
        }
        let echoes = quartile as f64 / *echo.get_or_insert(quartile) as f64;
        let spread = format!("{} to {}", figure(least), figure(most));
        let shown = before.map_or("-".to_owned(), figure);
        println!("{:<44}{:>9}  {spread:<17}{echoes:>6.2}{shown:>9}", transaction.name, figure(quartile));
        table += &format!("| {} | {} | {spread} | {echoes:.2} |\n", transaction.name, figure(quartile));
        match before {
            Some(before) if !is_more(least, before) => {}
            Some(before) => {
                more.push(format!("{}: {least} instructions at least, not {before}", transaction.name));
            }
            None => more.push(format!("{}: not in the table", transaction.name)),
        }
    }
    if let (Some(echo), Some(reading)) = (echo, reading)
        && reading * 10 > echo * ECHOES
    {
        return Err(format!("{READING} costs {reading} instructions, the echo {echo}: more than 2.5 times"));
    }
    if write {
        return TABLE.write(&table);
    }
    if more.is_empty() {
        return Ok(());
    }
    let more = format!("{}; cargo xtask cost --write where it has to be", more.join("; "));
    if printed.contains(&made_with) {
        return Err(more);
    }
    println!("{more}\n(not judged: {} was made with another compiler or emulator)", TABLE.file);
    Ok(())
}

/// Whether it costs more than before.
fn is_more(now: u64, before: u64) -> bool {
    now * 100 > before * (100 + ALLOWED)
}

/// Measures a transaction, and again where it costs more than before.
fn look(rig: &Rig, transaction: &Transaction, before: Option<u64>) -> Result<Cost, String> {
    let mut cost = measure(rig, transaction)?;
    for _ in 0..SECOND_LOOKS {
        if !before.is_some_and(|before| is_more(cost.least, before)) {
            break;
        }
        let again = measure(rig, transaction)?;
        if again.least < cost.least {
            cost = again;
        }
    }
    Ok(cost)
}

/// What some batches cost on one open connection, without what the firmware does by itself in the same time.
fn measure(rig: &Rig, transaction: &Transaction) -> Result<Cost, String> {
    let mut connection = (transaction.connect)(&rig.board)?;
    for _ in 0..WARM_UP {
        // One that is not answered shows in the batches.
        let _ = transaction.exchange(&mut connection);
    }
    thread::sleep(SETTLE);
    let idle = rig.idle()?;
    let mut retries = RETRIES;
    let mut costs = Vec::new();
    while costs.len() < transaction.batches {
        match batch(rig, transaction, &mut connection, idle) {
            Ok(cost) => costs.push(cost),
            Err(error) if retries == 0 => return Err(format!("{}: {error}", transaction.name)),
            Err(_) => {
                retries -= 1;
                // A slave that did not answer rests for a while.
                thread::sleep(Duration::from_secs(2));
                connection = (transaction.connect)(&rig.board)?;
                let _ = transaction.exchange(&mut connection);
                thread::sleep(SETTLE);
            }
        }
    }
    costs.sort_unstable();
    match *costs.as_slice() {
        [least, .., most] => Ok(Cost { quartile: costs[costs.len() / 4], least, most }),
        _ => Err("fewer than two batches".into()),
    }
}

/// Instructions of one transaction, of a row of them; `idle` is what is spent in a second without any.
fn batch(
    rig: &Rig,
    transaction: &Transaction,
    connection: &mut Connection,
    idle: f64,
) -> Result<u64, String> {
    let (before, start) = (rig.counted()?, Instant::now());
    for _ in 0..transaction.batch {
        transaction.exchange(connection)?;
    }
    thread::sleep(SETTLE);
    let (after, time) = (rig.counted()?, start.elapsed());
    let spent = (after - before) as f64 - idle * time.as_secs_f64();
    Ok((spent / f64::from(transaction.batch)).round() as u64)
}

/// What `--version` says of a program, its first line.
fn version(name: &str) -> Result<String, String> {
    let text = output(program(name).arg("--version"))?;
    Ok(text.lines().next().unwrap_or_default().to_owned())
}
