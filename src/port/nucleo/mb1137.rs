//! What NUCLEO-F767ZI and NUCLEO-F429ZI share, which are the same board (MB1137) with chips of like clocks.

use embassy_stm32::Config;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;

pub(super) use embassy_stm32::peripherals::{ADC1 as TemperatureAdc, CAN1, CAN2};

/// What only this board has in its place: the pin of LD2, blue, the ADC of the temperature sensor, and the CAN controllers.
macro_rules! own {
    ($peripherals:ident) => {
        Own {
            ld2: $peripherals.PB7.into(),
            adc: $peripherals.ADC1,
            can1: $peripherals.CAN1,
            can2: $peripherals.CAN2,
        }
    };
}
pub(super) use own;

/// As many MHz for processor and buses as `mul` has, a quarter and a half of them for the peripherals, and 48 MHz for the
/// random numbers by `divq`, from the 8 MHz that the ST-LINK supplies.
pub(super) fn clocks(mul: PllMul, divq: PllQDiv) -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz::mhz(8), mode: HseMode::Bypass });
    rcc.pll_src = PllSource::HSE;
    rcc.pll =
        Some(Pll { prediv: PllPreDiv::DIV4, mul, divp: Some(PllPDiv::DIV2), divq: Some(divq), divr: None });
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV1;
    rcc.apb1_pre = APBPrescaler::DIV4;
    rcc.apb2_pre = APBPrescaler::DIV2;
    config
}
