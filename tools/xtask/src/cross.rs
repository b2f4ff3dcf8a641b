//! The compiler for Cortex-M.

use std::path::Path;
use std::process::Command;

use crate::command::{cargo, install_debian, output, program, works};

pub const TARGET: &str = "thumbv7em-none-eabihf";

/// The linker of the Debian way. Older ones lack `--remap-inputs`, which build.rs needs.
const DEBIAN_LLD: &str = "ld.lld-19";
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "rust-web-src", "cargo-web", "lld-19"];

/// A way to build for [`TARGET`].
pub enum Cross {
    /// The target's libraries are installed.
    Installed,
    /// Debian's compiler builds the core library from its source.
    Debian,
}

impl Cross {
    /// Finds a way, and installs what it takes where it can.
    pub fn find() -> Result<Self, String> {
        if installed() || (works(program("rustup").args(["target", "add", TARGET])) && installed()) {
            return Ok(Self::Installed);
        }
        if !debian() {
            install_debian(&DEBIAN_PACKAGES).map_err(|why| {
                format!("no compiler for {TARGET}: run `rustup target add {TARGET}`; without rustup: {why}")
            })?;
        }
        if debian() {
            Ok(Self::Debian)
        } else {
            Err(format!("no compiler for {TARGET} in {DEBIAN_PACKAGES:?}"))
        }
    }

    /// Its compiler.
    pub fn compiler(&self) -> String {
        match self {
            Self::Installed => std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into()),
            Self::Debian => DEBIAN_RUSTC.into(),
        }
    }

    /// A cargo command such as `build` for the target.
    pub fn cargo(&self, command: &str) -> Command {
        let mut cargo = cargo();
        cargo.arg(command);
        if let Self::Debian = self {
            cargo.env("RUSTC_BOOTSTRAP", "1").env("RUSTC", DEBIAN_RUSTC);
            cargo.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER", DEBIAN_LLD);
            cargo.arg("-Zbuild-std=core");
        }
        cargo.args(["--target", TARGET]);
        cargo
    }
}

fn installed() -> bool {
    let rustc = std::env::var("RUSTC").unwrap_or_else(|_| "rustc".into());
    output(program(&rustc).args(["--print", "target-libdir", "--target", TARGET]))
        .is_ok_and(|folder| Path::new(folder.trim()).is_dir())
}

fn debian() -> bool {
    let source = Path::new("/usr/lib/rustlib/src/rust/library");
    works(program(DEBIAN_RUSTC).arg("--version"))
        && source.is_dir()
        && works(program(DEBIAN_LLD).arg("--version"))
}
