//! The log, to QEMU's standard error.

use core::fmt;

use log::{LevelFilter, Metadata, Record};

use super::host;
use crate::port::journal;

pub(super) fn start() {
    journal::start(LevelFilter::Info);
}

/// Whether such a line is shown.
pub(in crate::port) fn logs(_: &Metadata<'_>) -> bool {
    true
}

/// Shows a line.
pub(in crate::port) fn log(_: &Record<'_>, line: &str) {
    host::say(format_args!("{line}"));
}

/// Shows why the firmware has failed.
pub(in crate::port) fn last_words(text: fmt::Arguments<'_>) {
    host::say(text);
}
