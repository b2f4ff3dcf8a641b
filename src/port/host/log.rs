//! The log on standard error.

use std::sync::OnceLock;

use env_logger::{Builder, Env, Logger};
use log::{Log, Metadata, Record};

use crate::port::journal;

static STDERR: OnceLock<Logger> = OnceLock::new();

/// Starts the log; the variable `RUST_LOG` chooses what is shown.
pub fn start_log() {
    let logger = STDERR.get_or_init(|| Builder::from_env(Env::default().default_filter_or("info")).build());
    journal::start(logger.filter());
}

/// Whether such a line is shown.
pub(in crate::port) fn logs(metadata: &Metadata<'_>) -> bool {
    STDERR.get().is_some_and(|logger| logger.enabled(metadata))
}

/// Shows a line.
pub(in crate::port) fn log(record: &Record<'_>, _: &str) {
    if let Some(logger) = STDERR.get() {
        logger.log(record);
    }
}
