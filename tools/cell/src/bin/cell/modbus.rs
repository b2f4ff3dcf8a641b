//! A Modbus line.

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;

use puente_cell::live::{self, Port, Received};
use puente_cell::{Cell, Event};
use puente_line::Instant;

use crate::options::ModbusOptions;

/// Opens the port and serves it; the error is a sentence.
pub fn run(options: ModbusOptions) -> Result<(), String> {
    let log = match options.log.as_deref() {
        None => None,
        Some("-") => Some(Box::new(io::stdout()) as Box<dyn Write>),
        Some(path) => {
            let file = File::create(path).map_err(|error| format!("cannot write the log {path}: {error}"))?;
            Some(Box::new(file) as Box<dyn Write>)
        }
    };
    let mut port = Port::open(&options.port, options.config.line)?;
    let mut cell = Cell::new(options.config);
    for (unit, fault) in options.faults {
        if !cell.set_fault(unit, fault) {
            return Err(format!("a fault names unit {unit}, which is not in the cell"));
        }
    }
    println!("ready {}", port.name());
    serve(&mut cell, &mut port, log).map_err(|error| format!("the line failed: {error}"))
}

/// Carries bytes between the port and the cell until the port fails.
fn serve(cell: &mut Cell, port: &mut Port, mut log: Option<Box<dyn Write>>) -> io::Result<()> {
    live::exact_timers();
    let start = std::time::Instant::now();
    let now = || Instant::from_micros(start.elapsed().as_micros() as u64);
    let mut buffer = Vec::new();
    loop {
        let bytes = cell.poll(now());
        // Logged first, so that who has a reply finds it in the log.
        for (at, event) in cell.take_events() {
            if let Some(log) = &mut log {
                writeln!(log, "{}", line_of(at, &event))?;
                log.flush()?;
            }
        }
        if let Some(bytes) = bytes {
            port.write(&bytes)?;
        }
        live::wait([port.as_fd()], cell.poll_at().map(|at| at.since(now())))?;
        while port.receive(&mut buffer)? != Received::Nothing {}
        if !buffer.is_empty() {
            cell.receive(now(), &buffer);
            buffer.clear();
        }
    }
}

/// Microseconds since the start, direction, and the bytes: of a request unit and PDU, of a reply all on the line.
fn line_of(at: Instant, event: &Event) -> String {
    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02X}")).collect::<String>();
    let at = at.as_micros();
    match event {
        Event::Request { unit, pdu } => format!("{at} > {unit:02X}{}", hex(pdu)),
        Event::Reply(bytes) => format!("{at} < {}", hex(bytes)),
        Event::NoFrame(error) => format!("{at} ! {error}"),
    }
}
