//! `cargo xtask fuzz`: the fuzz targets of fuzz/, which is a workspace of its own.

use std::fs;
use std::process::Command;
use std::time::Duration;

use crate::Outcome;
use crate::command::{Options, cargo, program, root, run as run_command, works};

/// How long `--smoke` runs each target.
const SMOKE: Duration = Duration::from_secs(60);

pub fn run(arguments: &[String]) -> Outcome {
    let mut options = Options::new(arguments);
    let time = options.flag("--smoke").then_some(SMOKE);
    let target = options.word();
    options.end()?;
    match target {
        Some(target) if !targets()?.iter().any(|known| known == target) => {
            Err(format!("no target `{target}`; there are {}", names()))
        }
        Some(target) => {
            let way = Way::find()?;
            way.fuzz(target, time)
        }
        None => all(time.ok_or_else(|| format!("name a target, or --smoke for all: {}", names()))?),
    }
}

/// Runs every target for `time`.
pub fn all(time: Duration) -> Outcome {
    let targets = targets()?;
    let way = Way::find()?;
    for target in &targets {
        println!("fuzz {target} for {} s", time.as_secs());
        way.fuzz(target, Some(time))?;
    }
    Ok(())
}

fn names() -> String {
    targets().map_or_else(|error| error, |targets| targets.join(", "))
}

fn targets() -> Result<Vec<String>, String> {
    let folder = root().join("fuzz/fuzz_targets");
    let entries = fs::read_dir(&folder).map_err(|error| format!("fuzz/fuzz_targets: {error}"))?;
    let files = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut targets: Vec<_> = files.filter_map(|file| file.strip_suffix(".rs").map(str::to_owned)).collect();
    targets.sort();
    if targets.is_empty() { Err("fuzz/fuzz_targets is empty".into()) } else { Ok(targets) }
}

/// Fuzzing needs compiler options that only nightly offers.
enum Way {
    Nightly,
    /// The installed compiler, told to accept them.
    Bootstrap,
}

impl Way {
    fn find() -> Result<Self, String> {
        if !works(cargo().args(["fuzz", "--version"])) {
            println!("installing cargo-fuzz");
            run_command(cargo().args(["install", "cargo-fuzz", "--locked", "--quiet"]))?;
        }
        if works(program("rustc").args(["+nightly", "--version"])) {
            return Ok(Self::Nightly);
        }
        println!("no nightly compiler (`rustup toolchain install nightly`): fuzzing with this one");
        Ok(Self::Bootstrap)
    }

    fn fuzz(&self, target: &str, time: Option<Duration>) -> Outcome {
        let mut command: Command = match self {
            // The rustup proxy: the cargo that runs us would not change to another toolchain.
            Self::Nightly => {
                let mut command = program("cargo");
                command.env_remove("RUSTUP_TOOLCHAIN").arg("+nightly");
                command
            }
            Self::Bootstrap => {
                let mut command = cargo();
                command.env("RUSTC_BOOTSTRAP", "1");
                command
            }
        };
        command.args(["fuzz", "run", target, "--"]);
        if let Some(time) = time {
            command.arg(format!("-max_total_time={}", time.as_secs()));
        }
        run_command(&mut command)
    }
}
