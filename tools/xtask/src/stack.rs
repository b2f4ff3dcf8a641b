//! `cargo xtask stack`: the functions of the firmware that take most of the stack.

use std::fs;

use object::{Object, ObjectSection, ObjectSymbol};

use crate::Outcome;
use crate::board::{self, BOARDS, Board};
use crate::command::{Options, run as run_command, target_dir};
use crate::cross::{Cross, TARGET};
use crate::firmware::{PROFILE, of_board};

/// The part of the stack that one function may take: callers and interrupts need the rest. This finds what overflows
/// for certain; it does not prove that the calls together fit.
const SHARE: u64 = 2;

pub fn run(arguments: &[String]) -> Outcome {
    let mut options = Options::new(arguments);
    let default = BOARDS.first().map_or("all", |board| board.name);
    let boards = board::named(options.value("--board")?.unwrap_or(default))?;
    let top =
        options.value("--top")?.map(str::parse).transpose().map_err(|error| format!("--top: {error}"))?;
    options.end()?;
    let cross = Cross::find()?;
    boards.iter().try_for_each(|board| check(&cross, board, top.unwrap_or(3)))
}

fn check(cross: &Cross, board: &Board, top: usize) -> Outcome {
    let image = build(cross, board)?;
    let file = object::File::parse(image.as_slice()).map_err(|error| error.to_string())?;
    let address = |name| file.symbol_by_name(name).map_or(0, |symbol| symbol.address());
    let stack = address("_stack_start").saturating_sub(address("_stack_end"));
    let mut frames = frames(&file)?;
    frames.sort_by_key(|&(_, size)| std::cmp::Reverse(size));
    println!("{}: {stack} bytes of stack; the largest functions", board.name);
    for &(function, size) in frames.iter().take(top) {
        println!("{size:>8}  {}", name(&file, function));
    }
    match frames.first() {
        None => Err("the image tells no stack sizes".into()),
        Some(&(function, size)) if size > stack / SHARE => Err(format!(
            "{}: {} takes {size} bytes of stack, {} are allowed",
            board.name,
            name(&file, function),
            stack / SHARE
        )),
        Some(_) => Ok(()),
    }
}

/// The image with a section that tells the stack size of each function. That takes a compiler option which is not
/// stable yet, and a target folder of its own.
fn build(cross: &Cross, board: &Board) -> Result<Vec<u8>, String> {
    let target = target_dir()?.join("stack");
    let mut cargo = of_board(cross.cargo("build"), board);
    cargo.env("RUSTC_BOOTSTRAP", "1").env("RUSTFLAGS", "-Zemit-stack-sizes").env("CARGO_TARGET_DIR", &target);
    run_command(cargo.args(["--profile", PROFILE, "--quiet"]))?;
    let image = target.join(TARGET).join(PROFILE).join(board.program.name());
    fs::read(&image).map_err(|error| format!("{}: {error}", image.display()))
}

/// Address and stack size of each function: a 4-byte address, then the size as ULEB128.
fn frames(file: &object::File<'_>) -> Result<Vec<(u64, u64)>, String> {
    let section = file.section_by_name(".stack_sizes").ok_or("the image tells no stack sizes")?;
    let mut data = section.data().map_err(|error| error.to_string())?;
    let mut frames = Vec::new();
    while let Some((&address, rest)) = data.split_first_chunk::<4>() {
        let (size, rest) = uleb128(rest).ok_or("the section .stack_sizes is cut off")?;
        frames.push((u64::from(u32::from_le_bytes(address)), size));
        data = rest;
    }
    Ok(frames)
}

fn uleb128(data: &[u8]) -> Option<(u64, &[u8])> {
    let length = data.iter().position(|byte| byte & 0x80 == 0)? + 1;
    let (digits, rest) = data.split_at_checked(length)?;
    let value = digits
        .iter()
        .rev()
        .try_fold(0_u64, |value, byte| Some(value.checked_mul(0x80)? | u64::from(byte & 0x7F)))?;
    Some((value, rest))
}

fn name(file: &object::File<'_>, address: u64) -> String {
    // Thumb functions have an odd address in the symbol table.
    let symbol = file.symbols().find(|symbol| symbol.address() & !1 == address & !1 && symbol.size() > 0);
    let name = symbol.and_then(|symbol| symbol.name().ok()).unwrap_or("?").to_owned();
    format!("{:#}", rustc_demangle::demangle(&name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_numbers_of_any_length() {
        assert_eq!(uleb128(&[0x08, 0xFF]), Some((8, &[0xFF][..])));
        assert_eq!(uleb128(&[0xE5, 0x8E, 0x26]), Some((624_485, &[][..])));
        assert_eq!(uleb128(&[0x80]), None);
        assert_eq!(uleb128(&[]), None);
    }
}
