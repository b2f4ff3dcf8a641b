//! The application's log, to QEMU's standard error.

use log::{LevelFilter, Log, Metadata, Record};

use super::host;

struct Semihosting;

impl Log for Semihosting {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &Record<'_>) {
        let ms = embassy_time::Instant::now().as_millis();
        let (seconds, ms) = (ms / 1000, ms % 1000);
        host::say(format_args!("[{seconds:5}.{ms:03} {:<5}] {}", record.level(), record.args()));
    }

    fn flush(&self) {}
}

pub(super) fn start() {
    // Refused only where there is a logger already.
    if log::set_logger(&Semihosting).is_ok() {
        log::set_max_level(LevelFilter::Info);
    }
}
