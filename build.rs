//! Links an embedded build: the start-up and log sections, and the memory of the chosen board.

use std::env;
use std::path::Path;

/// Boards, and the memory file of each. The linker finds `memory.x` at the root by itself: it looks in the folder it
/// is called in first, so that another board's file has to be put in its place by name.
const BOARDS: [(&str, &str); 4] = [
    ("NUCLEO_H753ZI", "memory.x"),
    ("NUCLEO_F767ZI", "src/port/nucleo/f767zi.x"),
    ("NUCLEO_F429ZI", "src/port/nucleo/f429zi.x"),
    ("MPS2_AN500", "src/port/mps2/memory.x"),
];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let mut boards =
        BOARDS.iter().filter(|(board, _)| env::var_os(format!("CARGO_FEATURE_{board}")).is_some());
    let (Some((_, memory)), None) = (boards.next(), boards.next()) else {
        panic!(
            "choose one board: --no-default-features --features nucleo-h753zi (or nucleo-f767zi, nucleo-f429zi, mps2-an500)"
        );
    };
    println!("cargo:rerun-if-changed={memory}");
    let log = env::var_os("CARGO_FEATURE_NUCLEO").map(|_| "-Tdefmt.x");
    for argument in ["--nmagic", "-Tlink.x"].into_iter().chain(log) {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    if *memory != "memory.x" {
        let root = env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
        let file = Path::new(&root).join(memory);
        println!("cargo:rustc-link-arg-bins=--remap-inputs=memory.x={}", file.display());
    }
}
