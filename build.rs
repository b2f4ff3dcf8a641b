//! Tells the program what it is built from, and links an embedded build: the start-up and log sections, and the memory
//! of the chosen board.

use std::env;
use std::path::Path;
use std::process::Command;

/// Boards, and the memory file of each. The linker finds `memory.x` at the root by itself: it looks in the folder it
/// is called in first, so that another board's file has to be put in its place by name.
const BOARDS: [(&str, &str); 5] = [
    ("nucleo-h753zi", "memory.x"),
    ("nucleo-f767zi", "src/port/nucleo/f767zi.x"),
    ("nucleo-f429zi", "src/port/nucleo/f429zi.x"),
    ("nucleo-g474re", "src/port/g474re/memory.x"),
    ("mps2-an500", "src/port/mps2/memory.x"),
];
/// The boards that have no network, and so nothing of the gateway: they run a PID interface module.
const WITHOUT_NETWORK: [&str; 1] = ["nucleo-g474re"];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(network)");
    let root = env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    println!("cargo:rustc-env=PUENTE_COMMIT={}", commit(&root).as_deref().unwrap_or("unknown"));
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        println!("cargo:rustc-env=PUENTE_BOARD=host");
        println!("cargo:rustc-cfg=network");
        return;
    }
    let mut boards = BOARDS.iter().filter(|(board, _)| env::var_os(feature(board)).is_some());
    let (Some((board, memory)), None) = (boards.next(), boards.next()) else {
        panic!(
            "choose one board: --no-default-features --features nucleo-h753zi (or nucleo-f767zi, nucleo-f429zi, nucleo-g474re, mps2-an500)"
        );
    };
    println!("cargo:rustc-env=PUENTE_BOARD={board}");
    if !WITHOUT_NETWORK.contains(board) {
        println!("cargo:rustc-cfg=network");
    }
    println!("cargo:rerun-if-changed={memory}");
    let log = env::var_os("CARGO_FEATURE_NUCLEO").map(|_| "-Tdefmt.x");
    for argument in ["--nmagic", "-Tlink.x"].into_iter().chain(log) {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    if *memory != "memory.x" {
        let file = Path::new(&root).join(memory);
        println!("cargo:rustc-link-arg-bins=--remap-inputs=memory.x={}", file.display());
    }
}

/// The variable by which cargo tells that a board's feature is on.
fn feature(board: &str) -> String {
    format!("CARGO_FEATURE_{}", board.to_uppercase().replace('-', "_"))
}

/// The commit that is checked out, in short; none without git or outside a repository of this project's own.
fn commit(root: &str) -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(["-C", root, "rev-parse"]).args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim_end().to_owned())
    };
    if !git(&["--show-prefix"])?.is_empty() {
        return None;
    }
    // This file changes with every commit and checkout. Where there is none, an old commit may stay.
    let log = Path::new(root).join(git(&["--git-path", "logs/HEAD"])?);
    if log.exists() {
        println!("cargo:rerun-if-changed={}", log.display());
    }
    git(&["--short", "HEAD"])
}
