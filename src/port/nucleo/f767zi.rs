//! What only NUCLEO-F767ZI has (MB1137).

use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, bind_interrupts, pac, peripherals, rng};

bind_interrupts!(pub(super) struct RandomInterrupt {
    RNG => rng::InterruptHandler<peripherals::RNG>;
});

/// 216 MHz processor and buses, 54 and 108 MHz peripherals, 48 MHz for the random numbers, from the 8 MHz that the
/// ST-LINK supplies.
pub(super) fn config() -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz::mhz(8), mode: HseMode::Bypass });
    rcc.pll_src = PllSource::HSE;
    rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL216,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV9),
        divr: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    rcc.apb1_pre = APBPrescaler::DIV4;
    rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

/// SRAM2, which holds the Ethernet DMA's memory, is always clocked here.
pub(super) fn enable_ethernet_memory() {}

/// Baud rates that the USARTs can do at 54 MHz, with a divider of 16 bits.
pub(super) const BAUD: core::ops::RangeInclusive<u32> = 824..=1_000_000;

/// Size of a sector. There is one bank: the processor stands still while a sector is erased.
pub(super) const SECTOR: usize = 256 * 1024;
pub(super) const FLASH_READ: usize = 1;

/// Where the option bit nDBANK has been taken away, there are two banks with smaller sectors.
pub(super) fn flash_is_divided_as_known() -> bool {
    pac::FLASH.optcr().read().n_dbank()
}

/// Reads flash, which has no checksums here.
pub(super) fn read_flash(address: usize, bytes: &mut [u8]) {
    let flash = address as *const u8;
    for (number, byte) in bytes.iter_mut().enumerate() {
        // SAFETY: the caller stays within the flash.
        *byte = unsafe { flash.add(number).read_volatile() };
    }
}
