//! Running other programs, and reading options.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use crate::Outcome;

/// This cargo, at the root of the workspace.
pub fn cargo() -> Command {
    at_root(Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())))
}

/// Any program, at the root of the workspace.
pub fn program(name: &str) -> Command {
    at_root(Command::new(name))
}

fn at_root(mut command: Command) -> Command {
    command.current_dir(root());
    command
}

/// The workspace's folder.
pub fn root() -> PathBuf {
    let mut root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    root.pop();
    root.pop();
    root
}

/// Where cargo puts what it builds.
pub fn target_dir() -> Result<PathBuf, String> {
    let metadata = output(cargo().args(["metadata", "--format-version=1", "--no-deps"]))?;
    let (_, rest) =
        metadata.split_once("\"target_directory\":\"").ok_or("cargo metadata names no target directory")?;
    let (path, _) = rest.split_once('"').ok_or("cargo metadata is cut off")?;
    Ok(PathBuf::from(path.replace("\\\\", "\\")))
}

/// Runs to the end, and says how it was called where it fails.
pub fn run(command: &mut Command) -> Outcome {
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("`{}` ended with {status}", shown(command))),
        Err(error) => Err(format!("`{}`: {error}", shown(command))),
    }
}

/// What a program prints.
pub fn output(command: &mut Command) -> Result<String, String> {
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .map_err(|error| format!("`{}`: {error}", shown(command)))?;
    if !output.status.success() {
        return Err(format!("`{}` ended with {}", shown(command), output.status));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Whether a program is there and works, without a word.
pub fn works(command: &mut Command) -> bool {
    let quiet = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    quiet.status().is_ok_and(|status| status.success())
}

fn shown(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
}

/// Installs Debian packages where this user may, and otherwise says how to.
pub fn install_debian(packages: &[&str]) -> Outcome {
    let list = packages.join(" ");
    let root = output(program("id").arg("-u")).is_ok_and(|id| id.trim() == "0");
    if !root || !works(program("apt-get").arg("--version")) {
        return Err(format!("missing: {list}. On Debian: sudo apt-get install {list}"));
    }
    let apt = || {
        let mut apt = program("apt-get");
        apt.env("DEBIAN_FRONTEND", "noninteractive").stdout(Stdio::null());
        apt
    };
    println!("installing {list}");
    run(apt().arg("update"))?;
    run(apt().args(["install", "-y", "--no-install-recommends"]).args(packages))
}

/// Options of the form `--name VALUE` and `--name`; what is left over are plain words.
pub struct Options<'a> {
    left: Vec<&'a str>,
}

impl<'a> Options<'a> {
    pub fn new(arguments: &'a [String]) -> Self {
        Self { left: arguments.iter().map(String::as_str).collect() }
    }

    /// Takes `name` out, and says whether it was there.
    pub fn flag(&mut self, name: &str) -> bool {
        let before = self.left.len();
        self.left.retain(|word| *word != name);
        self.left.len() < before
    }

    /// Takes `name` and the word after it out.
    pub fn value(&mut self, name: &str) -> Result<Option<&'a str>, String> {
        let Some(at) = self.left.iter().position(|word| *word == name) else {
            return Ok(None);
        };
        self.left.remove(at);
        if at >= self.left.len() {
            return Err(format!("{name} needs a value"));
        }
        Ok(Some(self.left.remove(at)))
    }

    /// Takes the first plain word out.
    pub fn word(&mut self) -> Option<&'a str> {
        let at = self.left.iter().position(|word| !word.starts_with('-'))?;
        Some(self.left.remove(at))
    }

    /// Refuses what nobody took.
    pub fn end(self) -> Outcome {
        match self.left.first() {
            Some(word) => Err(format!("unknown: {word}")),
            None => Ok(()),
        }
    }
}
