//! The clocks.

use embassy_stm32::rcc::{Hse, HseMode, Pll, PllMul, PllPreDiv, PllRDiv, PllSource, Sysclk};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, pac};

/// 170 MHz for everything, from the crystal of 24 MHz.
pub(super) fn config() -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz::mhz(24), mode: HseMode::Oscillator });
    rcc.pll = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV6,
        mul: PllMul::MUL85,
        divp: None,
        divq: None,
        divr: Some(PllRDiv::DIV2),
    });
    // More than 150 MHz need it.
    rcc.boost = true;
    rcc.sys = Sysclk::PLL1_R;
    config
}

/// Switches the prefetch of the flash on, which has four wait states; its caches are on after reset (RM0440, FLASH_ACR).
pub(super) fn prepare() {
    pac::FLASH.acr().modify(|access| access.set_prften(true));
}
