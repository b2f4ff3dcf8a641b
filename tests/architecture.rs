//! Host alone: no gateway runs.
//!
//! Who may know whom: data flows one way, and the protocols know nothing but their protocol.

use std::fs;
use std::path::{Path, PathBuf};

/// The modules of `src/`, highest first. A module may name those that follow it, and no other. `module` is the application
/// of another program than the gateway, and knows nothing of it.
const LAYERS: [&str; 10] =
    ["app", "front", "settings", "axis", "motion", "desk", "bus", "module", "port", "clock"];

fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("folder") {
        let path = entry.expect("entry").path();
        if path.is_dir() {
            found.extend(files(&path, extension));
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
    found
}

/// The code of a file without its comments, line by line.
fn code(path: &Path) -> Vec<String> {
    let text = fs::read_to_string(path).expect("text");
    text.lines().map(|line| line.split("//").next().unwrap_or_default().to_owned()).collect()
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The module of `src/` that a file belongs to.
fn layer_of(file: &Path) -> String {
    let inside = file.strip_prefix(root().join("src")).expect("in src");
    let first = inside.components().next().expect("component").as_os_str().to_string_lossy();
    first.trim_end_matches(".rs").to_owned()
}

/// What follows each `crate::` in a line.
fn named(line: &str) -> impl Iterator<Item = &str> {
    line.split("crate::").skip(1).map(|rest| {
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        &rest[..end]
    })
}

#[test]
fn lower_layers_name_no_higher_ones() {
    let mut checked = 0;
    for file in files(&root().join("src"), "rs") {
        let layer = layer_of(&file);
        if layer == "lib" || layer == "bin" {
            continue;
        }
        let rank = LAYERS.iter().position(|name| *name == layer);
        let rank = rank.unwrap_or_else(|| panic!("{}: not a layer; add it to LAYERS", file.display()));
        for (number, line) in code(&file).iter().enumerate() {
            assert!(!line.contains("use crate::{"), "{}:{}: one `use` a layer", file.display(), number + 1);
            for name in named(line) {
                let other = LAYERS.iter().position(|layer| *layer == name);
                let allowed = other.is_some_and(|other| other >= rank);
                assert!(allowed, "{}:{}: {layer} must not name {name}", file.display(), number + 1);
                checked += 1;
            }
        }
    }
    assert!(checked > 50, "only {checked} names were found: does this test still read the code?");
}

#[test]
fn only_ports_and_the_wiring_know_the_platform() {
    for file in files(&root().join("src"), "rs") {
        let layer = layer_of(&file);
        if matches!(layer.as_str(), "port" | "app" | "bin" | "lib") {
            continue;
        }
        for (number, line) in code(&file).iter().enumerate() {
            let place = format!("{}:{}", file.display(), number + 1);
            assert!(!line.contains("target_os") && !line.contains("feature ="), "{place}: names a port");
            assert!(!line.contains("unsafe"), "{place}: unsafe belongs to port/");
            assert!(
                !line.contains("embassy_stm32") && !line.contains("embassy_net"),
                "{place}: names a chip"
            );
        }
    }
}

#[test]
fn protocols_are_sans_io() {
    let protocols = root().join("protocols");
    for file in files(&protocols, "rs") {
        for (number, line) in code(&file).iter().enumerate() {
            for word in line.split(|c: char| !c.is_alphanumeric() && c != '_') {
                let allowed = match word {
                    "unsafe_code" => true,
                    "async" | "await" | "alloc" | "unsafe" => false,
                    _ => !word.starts_with("embassy"),
                };
                assert!(allowed, "{}:{}: protocols have no `{word}`", file.display(), number + 1);
            }
        }
    }
    for entry in fs::read_dir(&protocols).expect("protocols") {
        let folder = entry.expect("entry").path();
        let lib = fs::read_to_string(folder.join("src/lib.rs")).expect("lib.rs");
        for attribute in ["#![no_std]", "#![forbid(unsafe_code)]", "#![deny(missing_docs)]"] {
            assert!(lib.contains(attribute), "{}: {attribute} is missing", folder.display());
        }
        let manifest = fs::read_to_string(folder.join("Cargo.toml")).expect("Cargo.toml");
        assert!(!manifest.contains("embassy"), "{}: depends on Embassy", folder.display());
    }
}

/// `cargo xtask emulate --test` runs every test file on the emulated board that does not begin with this and a reason.
#[test]
fn tests_that_no_board_passes_say_why() {
    const HOST_ALONE: &str = "//! Host alone: ";
    let of_the_host = ["run_to_end(", ".terminate(", ".pull("];
    for entry in fs::read_dir(root().join("tests")).expect("tests") {
        let path = entry.expect("entry").path();
        let sources = if path.is_dir() { files(&path, "rs") } else { vec![path.clone()] };
        let main = if path.is_dir() { path.join("main.rs") } else { path };
        if !main.is_file() || main.ends_with("architecture.rs") {
            continue;
        }
        let text = fs::read_to_string(&main).expect("text");
        let first = text.lines().next().expect("a line");
        match first.strip_prefix(HOST_ALONE) {
            Some(reason) => assert!(reason.len() > 10, "{}: why?", main.display()),
            None => {
                for word in of_the_host {
                    let found = sources.iter().find(|file| code(file).iter().any(|line| line.contains(word)));
                    assert!(found.is_none(), "{found:?}: a board has no `{word}`; begin with `{HOST_ALONE}`");
                }
            }
        }
    }
}
