//! `cargo xtask peers`: exchanges with Modbus programs that are not ours.
//!
//! tests/peers/run.py does the work. packages.txt beside it lists the Debian packages that it needs, requirements.txt
//! the Python ones; the latter go into an environment under the target folder.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::Outcome;
use crate::command::{cargo, install_debian, program, root, run as run_command, target_dir, works};

pub fn run(arguments: &[String]) -> Outcome {
    let folder = root().join("tests/peers");
    install_packages(&folder)?;
    let target = target_dir()?;
    let python = python(&folder, &target)?;
    run_command(cargo().args(["build", "--workspace", "--bins", "--quiet"]))?;
    let mut peers = Command::new(python);
    peers.current_dir(root()).arg(folder.join("run.py")).args(arguments);
    // Where the programs to test are.
    peers.env("PUENTE_BIN", target.join("debug")).env("PYTHONDONTWRITEBYTECODE", "1");
    run_command(&mut peers)
}

fn install_packages(folder: &Path) -> Outcome {
    let list = read(&folder.join("packages.txt"))?;
    let installed = |package: &&str| works(program("dpkg-query").args(["--show", package]));
    let missing: Vec<&str> = list.lines().map(str::trim).filter(|name| !name.is_empty()).collect();
    let missing: Vec<&str> = missing.into_iter().filter(|package| !installed(package)).collect();
    if missing.is_empty() { Ok(()) } else { install_debian(&missing) }
}

/// A Python with what requirements.txt lists.
fn python(folder: &Path, target: &Path) -> Result<std::path::PathBuf, String> {
    let environment = target.join("peers-python");
    let python = environment.join("bin/python");
    if !works(Command::new(&python).args(["-m", "pip", "--version"])) {
        let create = |()| run_command(program("python3").args(["-m", "venv"]).arg(&environment));
        create(()).or_else(|_| install_debian(&["python3", "python3-venv"]).and_then(create))?;
    }
    let requirements = folder.join("requirements.txt");
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--requirement"]);
    run_command(install.arg(requirements))?;
    Ok(python)
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}
