//! What only NUCLEO-F429ZI has (MB1137).

use embassy_stm32::adc::SampleTime;
use embassy_stm32::rcc::{PllMul, PllQDiv};
use embassy_stm32::{Config, bind_interrupts, pac, peripherals, rng};

use super::mb1137::clocks;
pub(super) use super::mb1137::{CAN1, CAN2, TemperatureAdc, own};

bind_interrupts!(pub(super) struct RandomInterrupt {
    HASH_RNG => rng::InterruptHandler<peripherals::RNG>;
});

/// Where the chip has the conversions of its temperature sensor at 30 and at 110 degrees Celsius (data sheet).
pub(super) const CALIBRATION: [usize; 2] = [0x1FFF_7A2C, 0x1FFF_7A2E];
/// 23 µs at 21 MHz; the sensor needs 10.
pub(super) const SAMPLE: SampleTime = SampleTime::CYCLES480;

/// 168 MHz processor and buses, 42 and 84 MHz peripherals, 48 MHz for the random numbers, from the 8 MHz that the
/// ST-LINK supplies. 180 MHz, the most that the chip can do, would leave no 48 MHz.
pub(super) fn config() -> Config {
    clocks(PllMul::MUL168, PllQDiv::DIV7)
}

/// Switches the caches of the flash on, which has wait states (RM0090, FLASH_ACR). All memory is always clocked here.
pub(super) fn prepare(_: &mut cortex_m::Peripherals) {
    pac::FLASH.acr().modify(|access| {
        access.set_icen(true);
        access.set_dcen(true);
        access.set_prften(true);
    });
}

/// Clock of the CAN controllers, in Hz.
pub(super) const CAN_CLOCK: u32 = 42_000_000;

/// Baud rates that the USARTs can do at 42 MHz, with a divider of 16 bits.
pub(super) const BAUD: core::ops::RangeInclusive<u32> = 641..=1_000_000;
/// They cannot do 7 data bits without parity.
pub(super) const SEVEN_BITS: bool = false;

/// Size of a sector. The last two are in bank 2; the processor stands still where code in that bank runs meanwhile.
pub(super) const SECTOR: usize = 128 * 1024;
pub(super) const FLASH_READ: usize = 1;

pub(super) fn flash_is_divided_as_known() -> bool {
    true
}

pub(super) use super::flash::read_plain as read_flash;
