//! Instructions of each step of the loop of a PID interface module, by encoder and state.

use std::collections::BTreeMap;
use std::fs;
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

use object::{Object, ObjectSymbol};
use puente_emulator::{AXIS_MODULE, Emulator, Setup};

use super::rig;
use crate::board::{Program, emulated};
use crate::command::target_dir;
use crate::docs::{Table, figure};
use crate::{Outcome, emulate, firmware};

const TABLE: Table = Table { file: "docs/module.md", name: "steps" };
/// A tenth of 170 MHz at 10 kHz, in cycles;
const CYCLES: u64 = 1_700;
/// and those of the interrupt's own entry and exit, with the registers of the FPU kept and brought back.
const ENTRY: u64 = 60;
/// Cycles that an instruction may take in the mean, in tenths: assumed. docs/module.md says why.
const FACTOR: u64 = 25;
/// All of it takes a second or two.
const PATIENCE: Duration = Duration::from_secs(120);
/// How the image says that it is through with one state, and with all.
const COUNTED: &str = "counted ";
const ALL: &str = "counted all";

/// The steps in one state.
struct Steps {
    name: String,
    mean: u64,
    most: u64,
}

/// Counts, and fails where it is too much. Where `write`, the table is written.
pub fn run(write: bool) -> Outcome {
    let steps = count()?;
    let made_with = format!("Made with {}, {}.", rig::compiler()?, rig::emulator()?);
    let mut table = format!("{made_with}\n\n| encoder: state | mean | most |\n|---|---|---|\n");
    println!("{:<60}{:>6}{:>6}", "step of the loop of a module", "mean", "most");
    for Steps { name, mean, most } in &steps {
        println!("{name:<60}{mean:>6}{most:>6}");
        table += &format!("| {name} | {} | {} |\n", figure(*mean), figure(*most));
    }
    let worst = steps.iter().max_by_key(|steps| steps.most).ok_or("no steps were counted")?;
    let cycles = worst.most * FACTOR / 10 + ENTRY;
    println!("{} instructions at most, or {cycles} cycles of {CYCLES}", worst.most);
    if cycles > CYCLES {
        let Steps { name, most, .. } = worst;
        return Err(format!("{name}: {most} instructions, or {cycles} cycles; {CYCLES} are allowed"));
    }
    if write { TABLE.write(&table) } else { Ok(()) }
}

fn count() -> Result<Vec<Steps>, String> {
    let image = emulate::image_of(firmware::build, &emulated(Program::LoopCost))?;
    let marks = marks(&image)?;
    let target = target_dir()?;
    let (counts, spans) = (target.join("loop-counts"), target.join("loop-spans"));
    let plugin = format!(
        "{},counts={},spans={},begins={},ends={},next={}",
        rig::plugin()?.display(),
        counts.display(),
        spans.display(),
        marks["span_begins"],
        marks["span_ends"],
        marks["span_next"],
    );
    // Nobody talks on its line.
    let line = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|line| line.local_addr());
    let line = line.map_err(|error| error.to_string())?;
    let setup = Setup {
        machine: AXIS_MODULE,
        lines: [None, None],
        user_network: false,
        plugin: Some(plugin),
        ..Setup::new(image, line)
    };
    let (sender, log) = mpsc::channel();
    let _board = Emulator::start(&setup, move |line| {
        let _ = sender.send(line.to_owned());
    })?;
    let mut names = Vec::new();
    loop {
        let line = log.recv_timeout(PATIENCE).map_err(|_| "the image does not come to its end")?;
        if line.ends_with(ALL) {
            break;
        }
        if let Some((_, name)) = line.split_once(COUNTED) {
            names.push(name.to_owned());
        }
    }
    let bytes = fs::read(&spans).map_err(|error| format!("{}: {error}", spans.display()))?;
    let numbers: Vec<u64> = bytes.as_chunks().0.iter().map(|number| u64::from_ne_bytes(*number)).collect();
    let steps = names.into_iter().zip(numbers.as_chunks().0).map(|(name, &[spans, instructions, most])| {
        let mean = instructions.checked_div(spans).ok_or(format!("{name}: no step was counted"))?;
        Ok(Steps { name, mean, most })
    });
    steps.collect()
}

/// The addresses of the marks in an image.
fn marks(image: &Path) -> Result<BTreeMap<String, u64>, String> {
    let bytes = fs::read(image).map_err(|error| format!("{}: {error}", image.display()))?;
    let file = object::File::parse(bytes.as_slice()).map_err(|error| error.to_string())?;
    let names = ["span_begins", "span_ends", "span_next"];
    let marks = names.map(|name| {
        let symbol = file.symbol_by_name(name).ok_or(format!("the image has no function {name}"))?;
        // That of a Thumb function is odd.
        Ok((name.to_owned(), symbol.address() & !1))
    });
    marks.into_iter().collect()
}
