//! The emulated board with a counter of its instructions, and simulated cells on its line and its CAN bus.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use puente_emulator::{Emulator, QEMU, Setup};

use crate::command::{cargo, run as run_command, target_dir};
use crate::cross::Cross;
use crate::emulate::{self, Cell, Door};
use crate::firmware;

/// The firmware has work of its own after its start: an address, the first probes.
const START: Duration = Duration::from_secs(2);
/// The factory settings but for the line, which is Modbus RTU at 115200 8E1, and a CAN bus.
const SETTINGS: &str = r#"{"net":{"port":80,"modbus_port":502},
"bus":[{"name":"a","protocol":"modbus-rtu","port":"rs485-a","baud":115200,"format":"8E1"},
{"name":"can","protocol":"canopen","port":"can-1","bitrate":1000000}],
"axis":[{"name":"x","bus":"a","drive":"edb","address":1}]}"#;
/// A window without transactions, and how many there are.
const IDLE: (Duration, usize) = (Duration::from_millis(200), 9);

pub struct Rig {
    pub board: Emulator,
    pub image: PathBuf,
    counts: File,
    _cells: [Cell; 2],
}

impl Rig {
    pub fn start() -> Result<Self, String> {
        let image = emulate::image(firmware::build_for_tests)?;
        run_command(cargo().args(["build", "--package", "cell", "--bin", "cell", "--quiet"]))?;
        let library = plugin()?;
        let target = target_dir()?;
        let cell = || Command::new(target.join("debug/cell"));
        let can = Cell::start(cell().args(["canopen", "--drive", "2=generic"]), Door::Slcan)?;
        let mut cell = cell();
        // As many registers as Modbus allows, where the drives have fewer; and the board's line alone keeps to the times
        // of the characters. The drive answers before TCP acknowledges the request by itself, after 10 ms.
        cell.args(["--protocol", "modbus-rtu", "--baud", "115200", "--format", "8E1"]);
        cell.args(["--max-read", "125", "--unpaced", "--reply-delay-ms", "1"]);
        let line = Cell::start(&mut cell, Door::Line)?;
        let counts = target.join("instructions");
        let plugin = format!("{},counts={}", library.display(), counts.display());
        let cans = [Some(can.address), None];
        let setup = Setup { plugin: Some(plugin), cans, ..Setup::new(&image, line.address) };
        let board = Emulator::start(&setup, |_| {})?;
        emulate::configure(board.main, SETTINGS, "modbus-rtu")?;
        thread::sleep(START);
        let counts = File::open(&counts).map_err(|error| format!("{}: {error}", counts.display()))?;
        Ok(Self { board, image, counts, _cells: [line, can] })
    }

    /// Instructions since the start.
    pub fn counted(&self) -> Result<u64, String> {
        let mut count = [0; 8];
        self.counts.read_exact_at(&mut count, 0).map_err(|error| format!("the counts: {error}"))?;
        Ok(u64::from_ne_bytes(count))
    }

    /// The same for each half-word of the code memory, of the blocks of code that begin there.
    pub fn counted_by_place(&self) -> Result<Vec<u64>, String> {
        let failed = |error| format!("the counts: {error}");
        let size = self.counts.metadata().map_err(failed)?.len() as usize;
        let mut counts = vec![0; size.saturating_sub(8)];
        self.counts.read_exact_at(&mut counts, 8).map_err(failed)?;
        Ok(counts.as_chunks().0.iter().map(|count| u64::from_ne_bytes(*count)).collect())
    }

    /// Instructions in a second without transactions.
    pub fn idle(&self) -> Result<f64, String> {
        let mut rates = Vec::new();
        for _ in 0..IDLE.1 {
            let (before, start) = (self.counted()?, Instant::now());
            thread::sleep(IDLE.0);
            rates.push((self.counted()? - before) as f64 / start.elapsed().as_secs_f64());
        }
        // Not the mean: what comes once in a while is not to be taken from each batch.
        rates.sort_unstable_by(f64::total_cmp);
        rates.get(rates.len() / 2).copied().ok_or_else(|| "no window".into())
    }
}

/// The plugin that counts, for the emulator that is there.
pub fn plugin() -> Result<PathBuf, String> {
    let mut plugin = cargo();
    plugin.args(["build", "--package", "puente-instructions", "--release", "--quiet"]);
    run_command(plugin.env("QEMU_PLUGIN_VERSION", interface(&emulator()?)))?;
    Ok(target_dir()?.join("release/libpuente_instructions.so"))
}

/// The compiler of the firmware.
pub fn compiler() -> Result<String, String> {
    super::version(&Cross::find()?.compiler())
}

/// The emulator.
pub fn emulator() -> Result<String, String> {
    super::version(QEMU)
}

/// The interface of plugins that a version of QEMU has: since 9.0 it takes none older than 2.
fn interface(version: &str) -> &'static str {
    let number = version.split_whitespace().find(|word| word.starts_with(|c: char| c.is_ascii_digit()));
    let major = number.and_then(|number| number.split('.').next()?.parse().ok());
    if major.is_some_and(|major: u32| major >= 9) { "2" } else { "1" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plugin_is_made_for_the_emulator() {
        for (version, expected) in [
            ("QEMU emulator version 7.2.22 (Debian 1:7.2+dfsg-7+deb12u18+b3)", "1"),
            ("QEMU emulator version 8.2.2", "1"),
            ("QEMU emulator version 10.0.2 (Debian 1:10.0.2+ds-2)", "2"),
        ] {
            assert_eq!(interface(version), expected, "{version}");
        }
    }
}
