//! A framed line, and what shall go wrong on it.

use std::io;
use std::time::Duration;

use puente_cell::framed::{Cell, Disturbance};
use puente_cell::live::{self, Port, Ports};
use puente_line::Instant;

use crate::input;
use crate::options::FramedOptions;

/// How late what is heard may be.
const REST: Duration = Duration::from_micros(100);

/// Opens the ports and serves them; the error is a sentence.
pub fn run(options: FramedOptions) -> Result<(), String> {
    let line = options.config.manners.line;
    let ports = options.ports.iter().map(|place| Port::open(place, line));
    let ports = ports.collect::<Result<Vec<_>, _>>()?;
    let mut cell = Cell::new(options.config).map_err(|error| error.to_string())?;
    for disturbance in options.disturbances {
        disturb(&mut cell, Instant::ZERO, disturbance)?;
    }
    for port in &ports {
        println!("ready {}", port.name());
    }
    serve(&mut cell, Ports::new(ports, REST)).map_err(|error| format!("the line failed: {error}"))
}

fn serve(cell: &mut Cell, mut ports: Ports) -> io::Result<()> {
    live::exact_timers();
    let input = input::lines();
    loop {
        ports.carry(cell)?;
        // The modules never rest for long, so that a line that is typed need not wake it.
        while let Ok(line) = input.try_recv() {
            match answer(cell, ports.now(), &line) {
                Ok(reply) => println!("{reply}"),
                Err(error) => println!("error {error}"),
            }
        }
        ports.wait(cell.poll_at())?;
    }
}

fn answer(cell: &mut Cell, now: Instant, line: &str) -> Result<String, String> {
    if line.trim() == "status" {
        return Ok(status(cell));
    }
    let disturbance = line.parse().map_err(|error| format!("{error}; see cell --help"))?;
    disturb(cell, now, disturbance).map(|()| "ok".into())
}

fn disturb(cell: &mut Cell, now: Instant, disturbance: Disturbance) -> Result<(), String> {
    match disturbance {
        _ if cell.disturb(now, disturbance) => Ok(()),
        Disturbance::Station(address, _) => {
            Err(format!("station {address} cannot have that, or is not there"))
        }
        _ => Err("it cannot be".into()),
    }
}

/// A line a module, and one for the line.
fn status(cell: &Cell) -> String {
    let module = |(address, module): (u8, &puente_cell::framed::Module)| {
        let status = module.status();
        format!(
            "{address} {}, position {}, set-point {}, velocity {:.0}, command {:.3}\n",
            status.state, status.position, status.set_point, status.velocity, status.command
        )
    };
    let totals = cell.totals();
    let modules: String = cell.modules().map(module).collect();
    format!(
        "{modules}ok characters={} spoiled={} flipped={}",
        totals.characters, totals.spoiled, totals.flipped
    )
}
