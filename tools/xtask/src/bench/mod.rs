//! `cargo xtask bench`: measurements, printed as a page of Markdown. Progress goes to stderr, the page to stdout:
//! `cargo xtask bench modbus > docs/bench.md`.
//!
//! `modbus`: the gateway and the simulated cell run as programs of their own, built for release. `csma`, `framed` and
//! `canopen`: virtual time.

mod canopen;
mod client;
mod csma;
mod framed;
mod machine;
mod modbus;
mod programs;
mod samples;

use crate::Outcome;

pub fn run(arguments: &[String]) -> Outcome {
    match arguments {
        [what] if what == "modbus" => modbus::run(),
        [what] if what == "csma" => csma::run(),
        [what] if what == "framed" => framed::run(),
        [what] if what == "canopen" => canopen::run(),
        [] => Err("say what to measure: modbus, csma, framed, canopen".into()),
        [word, ..] => Err(format!("unknown: {word}; there are: modbus, csma, framed, canopen")),
    }
}
