//! `cargo xtask size`: flash and RAM of the images against their budgets, and against what docs/boards.md says.

use std::fs;
use std::path::Path;

use object::elf::SHF_ALLOC;
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SectionKind};

use crate::Outcome;
use crate::board::{self, Board};
use crate::command::Options;
use crate::cross::Cross;
use crate::docs::{Table, figure, row, value};
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

/// Where the sizes are printed for those who have no compiler.
const TABLE: Table = Table { file: "docs/boards.md", name: "size" };
/// By so many percent a size may differ from what is printed: another compiler, or a small change.
const STALE: u64 = 5;

pub fn run(arguments: &[String]) -> Outcome {
    let mut options = Options::new(arguments);
    let write = options.flag("--write");
    let board = options.value("--board")?.unwrap_or("all");
    let boards = board::named(board)?;
    let top =
        options.value("--top")?.map(str::parse).transpose().map_err(|error| format!("--top: {error}"))?;
    options.end()?;
    if write && board != "all" {
        return Err("--write takes all boards".into());
    }
    let cross = Cross::find()?;
    let printed = TABLE.read()?;
    let mut wrong = Vec::new();
    let mut table = String::from("| board | flash | statics | stack |\n|---|---|---|---|\n");
    println!("{:<16}{:>9}{:>9}{:>9}{:>9}  (bytes)", "board", "flash", "statics", "stack", "RAM");
    for board in boards {
        let image = read(&firmware::build(&cross, board)?)?;
        let file = object::File::parse(image.as_slice()).map_err(|error| error.to_string())?;
        let size = measure(&file)?;
        let Size { flash, statics, stack } = size;
        println!("{:<16}{flash:>9}{statics:>9}{stack:>9}{:>9}", board.name, statics + stack);
        let [flash, statics, stack] = [flash, statics, stack].map(figure);
        table += &format!("| {} | {flash} | {statics} | {stack} |\n", board.name);
        wrong.extend(judge(board, &size));
        if !write && stale(&printed, board, &size) {
            wrong.push(format!("{} has other sizes of {}: cargo xtask size --write", TABLE.file, board.name));
        }
        largest(&file, top.unwrap_or(0));
    }
    if write {
        TABLE.write(&table)?;
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("; ")) }
}

/// Whether the sizes that are printed have little to do with these.
fn stale(printed: &str, board: &Board, size: &Size) -> bool {
    let cells = row(printed, board.name).unwrap_or_default();
    let figures: Vec<_> = cells.into_iter().map(value).collect();
    let [Some(flash), Some(statics), Some(stack)] = *figures else { return true };
    let pairs = [(flash, size.flash), (statics, size.statics), (stack, size.stack)];
    pairs.into_iter().any(|(printed, measured)| printed.abs_diff(measured) * 100 > printed * STALE)
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    fs::read(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// RAM of a Cortex-M, and the CCM of an STM32F4, which is where others have code: code and peripherals are elsewhere.
fn in_ram(address: u64) -> bool {
    matches!(address, 0x1000_0000..0x1001_0000 | 0x2000_0000..0x4000_0000)
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
    use crate::board::{Budget, Program};

    #[test]
    fn a_budget_counts_statics_and_stack_together() {
        let board =
            Board { name: "board", program: Program::Gateway, budget: Some(Budget { flash: 100, ram: 50 }) };
        assert_eq!(judge(&board, &Size { flash: 100, statics: 30, stack: 20 }), Vec::<String>::new());
        assert_eq!(
            judge(&board, &Size { flash: 101, statics: 30, stack: 21 }),
            ["board uses 101 bytes of flash, 100 are allowed", "board uses 51 bytes of RAM, 50 are allowed"]
        );
    }

    #[test]
    fn a_table_may_be_a_little_old() {
        let board = Board { name: "board", program: Program::Gateway, budget: None };
        let stale = |table: &str| stale(table, &board, &Size { flash: 1000, statics: 30, stack: 20 });
        assert!(!stale("| board | 1,040 | 30 | 20 |\n"));
        for table in
            ["| board | 1,060 | 30 | 20 |", "| board | 940 | 30 | 20 |", "| board | 1,000 |", "| other | 1 |"]
        {
            assert!(stale(table), "{table}");
        }
    }
}
