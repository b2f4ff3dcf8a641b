//! `cargo xtask size`: flash and RAM of the images against their budgets.

use std::fs;
use std::path::Path;

use object::elf::SHF_ALLOC;
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind};

use crate::Outcome;
use crate::board::{self, Board};
use crate::command::Options;
use crate::cross::Cross;
use crate::firmware;

/// What an image uses, in bytes.
#[derive(Debug, Default, PartialEq, Eq)]
struct Size {
    /// Vectors, code, constants, and the initial values of statics.
    flash: u64,
    /// Statics, buffers of the Ethernet DMA included.
    statics: u64,
    /// Reserved for the stack.
    stack: u64,
}

pub fn run(arguments: &[String]) -> Outcome {
    let mut options = Options::new(arguments);
    let boards = board::named(options.value("--board")?.unwrap_or("all"))?;
    let top =
        options.value("--top")?.map(str::parse).transpose().map_err(|error| format!("--top: {error}"))?;
    options.end()?;
    let cross = Cross::find()?;
    let mut over = Vec::new();
    println!("{:<16}{:>9}{:>9}{:>9}{:>9}  (bytes)", "board", "flash", "statics", "stack", "RAM");
    for board in boards {
        let image = read(&firmware::build(&cross, board)?)?;
        let file = object::File::parse(image.as_slice()).map_err(|error| error.to_string())?;
        let size = measure(&file)?;
        println!(
            "{:<16}{:>9}{:>9}{:>9}{:>9}",
            board.name,
            size.flash,
            size.statics,
            size.stack,
            size.statics + size.stack
        );
        over.extend(judge(board, &size));
        largest(&file, top.unwrap_or(0));
    }
    if over.is_empty() { Ok(()) } else { Err(over.join("; ")) }
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    fs::read(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// RAM of a Cortex-M: code and peripherals are elsewhere.
fn in_ram(address: u64) -> bool {
    (0x2000_0000..0x4000_0000).contains(&address)
}

fn measure(file: &object::File<'_>) -> Result<Size, String> {
    let mut size = Size::default();
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        if sh_flags & u64::from(SHF_ALLOC) == 0 {
            continue;
        }
        let stored = section.kind() != SectionKind::UninitializedData;
        if stored {
            size.flash += section.size();
        }
        if in_ram(section.address()) {
            size.statics += section.size();
        } else if !stored {
            return Err(format!("section {} is in no RAM", section.name().unwrap_or("?")));
        }
    }
    let address = |name| {
        let symbol = file.symbol_by_name(name).ok_or_else(|| format!("the image has no symbol {name}"))?;
        Ok::<u64, String>(symbol.address())
    };
    size.stack = address("_stack_start")?.saturating_sub(address("_stack_end")?);
    if size.flash == 0 || size.stack == 0 {
        return Err("the image is empty: it was linked without link.x".into());
    }
    Ok(size)
}

/// What is over the board's budget.
fn judge(board: &Board, size: &Size) -> Vec<String> {
    let Some(budget) = &board.budget else { return Vec::new() };
    let parts = [("flash", size.flash, budget.flash), ("RAM", size.statics + size.stack, budget.ram)];
    let over = parts.into_iter().filter(|(_, used, allowed)| used > allowed);
    over.map(|(what, used, allowed)| {
        format!("{} uses {used} bytes of {what}, {allowed} are allowed", board.name)
    })
    .collect()
}

/// Prints the statics that cost most.
fn largest(file: &object::File<'_>, count: usize) {
    let mut statics: Vec<_> =
        file.symbols().filter(|symbol| in_ram(symbol.address()) && symbol.size() > 0).collect();
    statics.sort_by_key(|symbol| std::cmp::Reverse(symbol.size()));
    for symbol in statics.iter().take(count) {
        let name = rustc_demangle::demangle(symbol.name().unwrap_or("?"));
        println!("{:>25}  {name:#}", symbol.size());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::Budget;

    #[test]
    fn a_budget_counts_statics_and_stack_together() {
        let board = Board { name: "board", budget: Some(Budget { flash: 100, ram: 50 }) };
        assert_eq!(judge(&board, &Size { flash: 100, statics: 30, stack: 20 }), Vec::<String>::new());
        assert_eq!(
            judge(&board, &Size { flash: 101, statics: 30, stack: 21 }),
            ["board uses 101 bytes of flash, 100 are allowed", "board uses 51 bytes of RAM, 50 are allowed"]
        );
    }
}
