//! The application's log, over RTT: `probe-rs run` shows it.

use defmt_rtt as _;
use log::{Level, LevelFilter, Log, Metadata, Record};

struct Rtt;

impl Log for Rtt {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &Record<'_>) {
        let text = defmt::Display2Format(record.args());
        match record.level() {
            Level::Error => defmt::error!("{}", text),
            Level::Warn => defmt::warn!("{}", text),
            Level::Info => defmt::info!("{}", text),
            Level::Debug => defmt::debug!("{}", text),
            Level::Trace => defmt::trace!("{}", text),
        }
    }

    fn flush(&self) {}
}

pub(super) fn start() {
    // Refused only where there is a logger already.
    if log::set_logger(&Rtt).is_ok() {
        log::set_max_level(LevelFilter::Info);
    }
}

defmt::timestamp!("{=u64:us}", embassy_time::Instant::now().as_micros());
