//! What only NUCLEO-F767ZI has (MB1137).

use embassy_stm32::adc::SampleTime;
use embassy_stm32::rcc::{PllMul, PllQDiv};
use embassy_stm32::{Config, bind_interrupts, pac, peripherals, rng};

use super::mb1137::clocks;
pub(super) use super::mb1137::{CAN1, CAN2, TemperatureAdc, own};

bind_interrupts!(pub(super) struct RandomInterrupt {
    RNG => rng::InterruptHandler<peripherals::RNG>;
});

/// Where the chip has the conversions of its temperature sensor at 30 and at 110 degrees Celsius (data sheet).
pub(super) const CALIBRATION: [usize; 2] = [0x1FF0_F44C, 0x1FF0_F44E];
/// 18 µs at 27 MHz; the sensor needs 10.
pub(super) const SAMPLE: SampleTime = SampleTime::CYCLES480;

/// 216 MHz processor and buses, 54 and 108 MHz peripherals, 48 MHz for the random numbers, from the 8 MHz that the
/// ST-LINK supplies.
pub(super) fn config() -> Config {
    clocks(PllMul::MUL216, PllQDiv::DIV9)
}

/// Clock of the CAN controllers, in Hz.
pub(super) const CAN_CLOCK: u32 = 54_000_000;

/// Baud rates that the USARTs can do at 54 MHz, with a divider of 16 bits.
pub(super) const BAUD: core::ops::RangeInclusive<u32> = 824..=1_000_000;
/// They can do 7 data bits without parity.
pub(super) const SEVEN_BITS: bool = true;

/// Size of a sector. There is one bank: the processor stands still while a sector is erased.
pub(super) const SECTOR: usize = 256 * 1024;
pub(super) const FLASH_READ: usize = 1;

/// Where the option bit nDBANK has been taken away, there are two banks with smaller sectors.
pub(super) fn flash_is_divided_as_known() -> bool {
    pac::FLASH.optcr().read().n_dbank()
}

pub(super) use super::flash::read_plain as read_flash;

/// Switches the instruction cache on, for flash has wait states; the data cache stays off: see net.rs. All memory is
/// always clocked here.
pub(super) fn prepare(core: &mut cortex_m::Peripherals) {
    core.SCB.enable_icache();
}
