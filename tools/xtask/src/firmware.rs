//! `cargo xtask firmware`: the images to flash.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Outcome;
use crate::board::{self, Board};
use crate::command::{Options, run as run_command, target_dir};
use crate::cross::{Cross, TARGET};

/// The profile of what is flashed.
pub const PROFILE: &str = "firmware";
/// The feature of images for tests.
pub const TEST_HOOKS: &str = "test-hooks";

pub fn run(arguments: &[String]) -> Outcome {
    let mut options = Options::new(arguments);
    let boards = board::named(options.value("--board")?.unwrap_or("all"))?;
    options.end()?;
    let cross = Cross::find()?;
    for board in boards {
        println!("{} {}", board.name, build(&cross, board)?.display());
    }
    Ok(())
}

/// Builds what a board runs, and returns its image: an ELF file. It has nothing that only tests may ask for.
pub fn build(cross: &Cross, board: &Board) -> Result<PathBuf, String> {
    let image = image(of_board(cross.cargo("build"), board), board, "")?;
    if has_hooks(&image)? { Err(format!("{} obeys `debug panic`", image.display())) } else { Ok(image) }
}

/// The same with what only tests may ask for.
pub fn build_for_tests(cross: &Cross, board: &Board) -> Result<PathBuf, String> {
    let mut cargo = of_board(cross.cargo("build"), board);
    cargo.args(["--features", TEST_HOOKS]);
    let image = image(cargo, board, "-test")?;
    if has_hooks(&image)? { Ok(image) } else { Err(format!("{} has no {TEST_HOOKS}", image.display())) }
}

/// Builds an image. Every board's comes out under the name of its program, and is kept under one of its own.
fn image(mut cargo: Command, board: &Board, suffix: &str) -> Result<PathBuf, String> {
    run_command(cargo.args(["--profile", PROFILE, "--quiet"]))?;
    let target = target_dir()?;
    let folder = target.join("firmware");
    let program = board.program.name();
    let image = folder.join(format!("{program}-{}{suffix}.elf", board.name));
    let built = target.join(TARGET).join(PROFILE).join(program);
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    fs::copy(&built, &image).map_err(|error| format!("{}: {error}", built.display()))?;
    Ok(image)
}

/// Whether an image has what only tests may ask for: by what `debug panic` says.
fn has_hooks(image: &Path) -> Result<bool, String> {
    let words = b"a test hook was asked for";
    let bytes = fs::read(image).map_err(|error| format!("{}: {error}", image.display()))?;
    Ok(bytes.windows(words.len()).any(|window| window == words))
}

/// Narrows a cargo command to what runs on a board.
pub fn of_board(mut cargo: Command, board: &Board) -> Command {
    cargo.args([
        "--package",
        "puente",
        "--bin",
        board.program.name(),
        "--no-default-features",
        "--features",
        &board.features(),
    ]);
    cargo
}
