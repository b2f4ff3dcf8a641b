//! The temperature of the chip.

use core::sync::atomic::{AtomicI16, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::adc::Adc;
use embassy_time::Timer;

use super::board::{CALIBRATION, SAMPLE, TemperatureAdc};
use super::calibration::degrees;

/// What stands for no temperature.
const NONE: i16 = i16::MIN;
static LAST: AtomicI16 = AtomicI16::new(NONE);

/// Temperature of the chip in degrees Celsius, not older than two seconds, where it is known.
pub fn temperature() -> Option<i16> {
    Some(LAST.load(Ordering::Relaxed)).filter(|&last| last != NONE)
}

/// Measures it every second.
#[embassy_executor::task]
pub(super) async fn watch(adc: Peri<'static, TemperatureAdc>) -> ! {
    let mut adc = Adc::new(adc);
    let mut sensor = adc.enable_temperature();
    // SAFETY: ST's data sheets have these two half-words there, in memory that can only be read.
    let calibration = CALIBRATION.map(|address| unsafe { (address as *const u16).read_volatile() });
    loop {
        // The sensor needs some microseconds before the first conversion.
        Timer::after_secs(1).await;
        let conversion = adc.blocking_read(&mut sensor, SAMPLE);
        LAST.store(degrees(conversion, calibration).unwrap_or(NONE), Ordering::Relaxed);
    }
}
