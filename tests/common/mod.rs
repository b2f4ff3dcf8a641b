//! A running gateway on either target, a line with slaves on it, and small clients. Nothing here knows the gateway's code.
#![allow(dead_code, reason = "each test file uses a part of it")]

mod board;
pub mod can;
pub mod client;
mod document;
pub mod ethernet;
pub mod framed;
mod gateway;
pub mod http;
pub mod rig;
pub mod servos;
pub mod table;
mod target;
pub mod wire;

use std::io::Read;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use puente_line::Settings;
use puente_modbus::Mode;

pub use document::Document;
pub use gateway::Gateway;
pub use target::target;

/// Both framings of a serial line.
pub const MODES: [Mode; 2] = [Mode::Rtu, Mode::Ascii];

/// The line's baud rate and format in all tests that do not need another: fast, so that frames take little time.
pub fn fast() -> Settings {
    Settings { baud: 115_200, format: "8E1".parse().expect("a format") }
}

/// The line of the thesis.
pub fn thesis() -> Settings {
    Settings { baud: 9_600, format: "8O1".parse().expect("a format") }
}

pub const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A path of its own in the directory for tests.
pub fn scratch(name: &str) -> PathBuf {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}-{number}", std::process::id()))
}

/// Runs the gateway for its options alone, which must end it.
pub fn run_to_end(arguments: &[&str]) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_gateway"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let deadline = Instant::now() + Duration::from_secs(20);
    while child.try_wait().expect("its state").is_none() {
        if Instant::now() > deadline {
            let _ = child.kill();
            let mut log = String::new();
            let _ = child.stderr.take().expect("its log").read_to_string(&mut log);
            panic!("{arguments:?} runs on:\n{log}");
        }
        thread::sleep(ms(2));
    }
    child.wait_with_output().expect("its output")
}

/// Ends threads that run while a flag is set, also when the test fails, which waits for them.
pub struct Ends<'a>(pub &'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Relaxed);
    }
}

/// Waits for something that is bound to happen.
pub fn until(what: &str, mut happened: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(20);
    while !happened() {
        assert!(Instant::now() < deadline, "never: {what}");
        thread::sleep(ms(2));
    }
}
