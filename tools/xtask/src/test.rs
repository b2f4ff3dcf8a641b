//! `cargo xtask test`: every check, in the order in which they tell most for their time.

use std::time::Instant;

use crate::board::{BOARDS, EMULATED, Program, emulated};
use crate::command::{cargo, program, run as run_command, works};
use crate::cross::Cross;
use crate::{Outcome, cost, emulate, firmware, fuzz, peers, size, stack};

/// Each fuzz target runs for a moment, always on the same input first, so that a check repeats; `cargo xtask fuzz --smoke`
/// is what searches.
const FUZZ: &[&str] = &["-max_total_time=3", "-seed=1"];

type Step = (&'static str, fn() -> Outcome);

const STEPS: &[Step] = &[
    ("format", format),
    ("lints", lints),
    ("lints of the firmware", firmware_lints),
    ("tests", tests),
    ("documentation", documentation),
    ("firmware", || firmware::run(&[])),
    ("size", || size::run(&[])),
    ("stack", || stack::run(&[])),
    ("emulated board", emulate::test),
    ("cost", || cost::run(&[])),
    ("fuzz", || fuzz::all(FUZZ)),
    ("peers", || peers::run(&[])),
];

pub fn run(arguments: &[String]) -> Outcome {
    if let Some(word) = arguments.first() {
        return Err(format!("unknown: {word}"));
    }
    let mut report = Vec::new();
    for (name, step) in STEPS {
        println!("== {name}");
        let start = Instant::now();
        let outcome = step();
        if let Err(why) = &outcome {
            println!("{why}");
        }
        report.push((name, outcome, start.elapsed()));
    }
    println!("== summary");
    for (name, outcome, time) in &report {
        println!(
            "{:<7}{:>6.1} s  {name}",
            if outcome.is_ok() { "passed" } else { "FAILED" },
            time.as_secs_f32()
        );
    }
    let failed = report.iter().filter(|(_, outcome, _)| outcome.is_err()).count();
    println!("{} passed, {failed} failed", report.len() - failed);
    if failed == 0 { Ok(()) } else { Err("some checks failed".into()) }
}

fn format() -> Outcome {
    component("rustfmt", "fmt")?;
    run_command(cargo().args(["fmt", "--all", "--check"]))
}

fn lints() -> Outcome {
    component("clippy", "clippy")?;
    run_command(cargo().args(["clippy", "--workspace", "--all-targets", "--quiet", "--", "-D", "warnings"]))
}

fn firmware_lints() -> Outcome {
    component("clippy", "clippy")?;
    let cross = Cross::find()?;
    let emulated = [Program::Gateway, Program::AxisModule, Program::LoopCost].map(emulated);
    for board in BOARDS.iter().chain(&emulated) {
        let mut clippy = firmware::of_board(cross.cargo("clippy"), board);
        run_command(clippy.args(["--lib", "--quiet", "--", "-D", "warnings"]))?;
    }
    let mut clippy = firmware::of_board(cross.cargo("clippy"), &EMULATED);
    clippy.args(["--features", firmware::TEST_HOOKS]);
    run_command(clippy.args(["--lib", "--quiet", "--", "-D", "warnings"]))?;
    Ok(())
}

fn tests() -> Outcome {
    run_command(cargo().args(["test", "--workspace", "--no-fail-fast", "--quiet"]))
}

fn documentation() -> Outcome {
    run_command(
        cargo().args(["doc", "--workspace", "--no-deps", "--quiet"]).env("RUSTDOCFLAGS", "-D warnings"),
    )
}

/// Makes sure of a part of the toolchain that rustup may have left out.
fn component(name: &str, subcommand: &str) -> Outcome {
    if works(cargo().args([subcommand, "--version"]))
        || works(program("rustup").args(["component", "add", name]))
    {
        return Ok(());
    }
    Err(format!("no {name}: run `rustup component add {name}`"))
}
