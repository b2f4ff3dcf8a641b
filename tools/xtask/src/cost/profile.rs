//! `cargo xtask cost --profile NAME`: the functions that a transaction spends most of its instructions in.

use std::collections::BTreeMap;
use std::fs;

use object::{Object, ObjectSymbol, SymbolKind};

use super::rig::Rig;
use super::transactions::Transaction;
use super::{SETTLE, WARM_UP};
use crate::Outcome;

/// How many functions are printed.
const TOP: usize = 40;

pub fn print(rig: &Rig, transaction: &Transaction) -> Outcome {
    let image = fs::read(&rig.image).map_err(|error| format!("{}: {error}", rig.image.display()))?;
    let file = object::File::parse(image.as_slice()).map_err(|error| error.to_string())?;
    let functions = functions(&file);
    let mut connection = (transaction.connect)(&rig.board)?;
    for _ in 0..WARM_UP {
        transaction.exchange(&mut connection)?;
    }
    std::thread::sleep(SETTLE);
    let before = rig.counted_by_place()?;
    for _ in 0..transaction.batch {
        transaction.exchange(&mut connection)?;
    }
    std::thread::sleep(SETTLE);
    let after = rig.counted_by_place()?;
    let mut spent: BTreeMap<&str, u64> = BTreeMap::new();
    for (half_word, (after, before)) in after.iter().zip(&before).enumerate() {
        if after > before {
            let function = functions.range(..=half_word as u64 * 2).next_back();
            *spent.entry(function.map_or("?", |(_, name)| name)).or_default() += after - before;
        }
    }
    let mut spent: Vec<_> = spent.into_iter().collect();
    spent.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    let each = |count: u64| count / u64::from(transaction.batch);
    println!("{}, with what the firmware does by itself meanwhile", transaction.name);
    println!("{:>9}  all", each(spent.iter().map(|(_, count)| count).sum()));
    for &(name, count) in spent.iter().take(TOP) {
        println!("{:>9}  {:#}", each(count), rustc_demangle::demangle(name));
    }
    Ok(())
}

/// The functions by their addresses; that of a Thumb function is odd in the table of symbols.
fn functions<'f>(file: &'f object::File<'_>) -> BTreeMap<u64, &'f str> {
    let functions = file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0);
    functions.filter_map(|symbol| Some((symbol.address() & !1, symbol.name().ok()?))).collect()
}
