//! A CAN bus with CANopen nodes, and what shall go wrong on it.

use std::fs::File;
use std::io::{self, Write};
use std::time::Duration;

use puente_cell::can::{Cell, Fault, Node};
use puente_cell::live;
use puente_cell::live::can::{Capture, Hub};
use puente_line::Instant;

use crate::input;
use crate::options::{CanopenOptions, fault};

/// How late a typed line may be, and a fault that has its time.
const REST: Duration = Duration::from_millis(20);

/// Opens the doors and serves them; the error is a sentence.
pub fn run(options: CanopenOptions) -> Result<(), String> {
    let captures = captures(&options)?;
    let mut cell = Cell::new(options.config);
    let hub = Hub::open(&mut cell, &options.doors)?;
    for name in hub.names() {
        println!("ready {name}");
    }
    serve(&mut cell, hub, captures, options.faults).map_err(|error| format!("the bus failed: {error}"))
}

fn captures(options: &CanopenOptions) -> Result<Vec<Capture>, String> {
    let create = |path: &str| -> Result<Box<dyn Write>, String> {
        match path {
            "-" => Ok(Box::new(io::stdout())),
            path => File::create(path)
                .map(|file| Box::new(file) as Box<dyn Write>)
                .map_err(|error| format!("cannot write {path}: {error}")),
        }
    };
    let mut captures = Vec::new();
    if let Some(path) = &options.log {
        captures.push(Capture::Lines(create(path)?));
    }
    if let Some(path) = &options.pcap {
        captures.push(Capture::pcap(create(path)?).map_err(|error| error.to_string())?);
    }
    Ok(captures)
}

fn serve(
    cell: &mut Cell,
    mut hub: Hub,
    mut captures: Vec<Capture>,
    mut faults: Vec<(Duration, u8, Fault)>,
) -> io::Result<()> {
    live::exact_timers();
    let input = input::lines();
    loop {
        for event in hub.carry(cell)? {
            captures.iter_mut().try_for_each(|capture| capture.write(&event))?;
        }
        let now = hub.now();
        for (_, node, fault) in faults.extract_if(.., |(at, ..)| Instant::ZERO + *at <= now) {
            if !cell.suffer(now, node, fault) {
                eprintln!("cell: there is no node {node} to go wrong");
            }
        }
        while let Ok(line) = input.try_recv() {
            match answer(cell, now, &line) {
                Ok(reply) => println!("{reply}"),
                Err(error) => println!("error {error}"),
            }
        }
        let rest = now + REST;
        hub.wait(Some(cell.poll_at().map_or(rest, |at| at.min(rest))))?;
    }
}

fn answer(cell: &mut Cell, now: Instant, line: &str) -> Result<String, String> {
    if line.trim() == "status" {
        return Ok(status(cell, now));
    }
    let (_, node, fault) = fault(line.trim())?;
    if cell.suffer(now, node, fault) { Ok("ok".into()) } else { Err(format!("there is no node {node}")) }
}

/// A line a node, and one for the bus.
fn status(cell: &Cell, now: Instant) -> String {
    let node = |node: &Node| {
        let id = node.id().map_or_else(|| "-".to_owned(), |id| id.to_string());
        let drive = node.drive().map_or_else(String::new, |drive| {
            format!(
                ", {}, mode {}, position {:.0}, velocity {:.0}",
                drive.state(),
                drive.mode(),
                drive.position(),
                drive.velocity()
            )
        });
        format!("{id} {} {}{drive}\n", node.model().name(), node.state())
    };
    let totals = cell.totals();
    let nodes: String = cell.nodes().iter().map(node).collect();
    let micros = now.as_micros().max(1);
    format!(
        "{nodes}ok frames={} errors={} dropped={} bits={} micros={micros}",
        totals.frames, totals.errors, totals.dropped, totals.bits
    )
}
