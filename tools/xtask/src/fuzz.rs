//! `cargo xtask fuzz`: the fuzz targets of fuzz/, which is a workspace of its own.

use std::fs;
use std::process::Command;

use crate::Outcome;
use crate::command::{Options, cargo, program, root, run as run_command, works};

/// `--smoke` runs each target for 60 s, each time on other input.
const SMOKE: &[&str] = &["-max_total_time=60"];
const CARGO_FUZZ: &str = "cargo-fuzz@0.13.2";

pub fn run(arguments: &[String]) -> Outcome {
    let mut options = Options::new(arguments);
    let smoke = options.flag("--smoke");
    let target = options.word();
    options.end()?;
    match target {
        Some(target) if !targets()?.iter().any(|known| known == target) => {
            Err(format!("no target `{target}`; there are {}", names()))
        }
        Some(target) => {
            let way = Way::find()?;
            way.fuzz(target, if smoke { SMOKE } else { &[] })
        }
        None if smoke => all(SMOKE),
        None => Err(format!("name a target, or --smoke for all: {}", names())),
    }
}

/// Runs every target with these options of libFuzzer.
pub fn all(options: &[&str]) -> Outcome {
    let targets = targets()?;
    let way = Way::find()?;
    for target in &targets {
        println!("fuzz {target} {}", options.join(" "));
        way.fuzz(target, options)?;
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
            println!("installing {CARGO_FUZZ}");
            run_command(cargo().args(["install", CARGO_FUZZ, "--locked", "--quiet"]))?;
        }
        if works(program("rustc").args(["+nightly", "--version"])) {
            return Ok(Self::Nightly);
        }
        println!("no nightly compiler (`rustup toolchain install nightly`): fuzzing with this one");
        Ok(Self::Bootstrap)
    }

    fn fuzz(&self, target: &str, options: &[&str]) -> Outcome {
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
        command.args(["fuzz", "run", target, "--"]).args(options);
        run_command(&mut command)
    }
}
