//! `cargo xtask bench`: measurements, printed as a page of Markdown. Progress goes to stderr, the page to stdout:
//! `cargo xtask bench modbus > docs/bench.md`.
//!
//! `modbus`, `sdo`: the gateway and the simulated cell run as programs of their own, built for release. `csma`, `framed` and
//! `canopen`: virtual time. `sync`: the gateway on the host, and the firmware on the emulated board, in real time.

mod canopen;
mod client;
mod csma;
mod framed;
mod machine;
mod modbus;
mod programs;
mod samples;
mod sdo;
mod sync;

use crate::Outcome;

pub fn run(arguments: &[String]) -> Outcome {
    match arguments {
        [what] if what == "modbus" => modbus::run(),
        [what] if what == "csma" => csma::run(),
        [what] if what == "framed" => framed::run(),
        [what] if what == "canopen" => canopen::run(),
        [what] if what == "sdo" => sdo::run(),
        [what] if what == "sync" => sync::run(),
        [] => Err("say what to measure: modbus, csma, framed, canopen, sdo, sync".into()),
        [word, ..] => Err(format!("unknown: {word}; there are: modbus, csma, framed, canopen, sdo, sync")),
    }
}
