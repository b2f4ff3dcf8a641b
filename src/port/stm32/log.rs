//! The log, over RTT: `probe-rs run` shows it.

use core::fmt;

use defmt_rtt as _;
use log::{Level, LevelFilter, Metadata, Record};

use crate::port::journal;

pub(in crate::port) fn start() {
    journal::start(LevelFilter::Info);
}

/// Whether such a line is shown.
pub(in crate::port) fn logs(_: &Metadata<'_>) -> bool {
    true
}

/// Shows a line; the debugger adds the time.
pub(in crate::port) fn log(record: &Record<'_>, _: &str) {
    let text = defmt::Display2Format(record.args());
    match record.level() {
        Level::Error => defmt::error!("{}", text),
        Level::Warn => defmt::warn!("{}", text),
        Level::Info => defmt::info!("{}", text),
        Level::Debug => defmt::debug!("{}", text),
        Level::Trace => defmt::trace!("{}", text),
    }
}

/// Shows why the firmware has failed. A debugger needs a moment to fetch the last line before the memory is written anew.
pub(in crate::port) fn last_words(text: fmt::Arguments<'_>) {
    defmt::error!("{}", defmt::Display2Format(&text));
    cortex_m::asm::delay(40_000_000);
}

defmt::timestamp!("{=u64:us}", embassy_time::Instant::now().as_micros());
