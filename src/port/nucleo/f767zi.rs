//! What only NUCLEO-F767ZI has (MB1137).

use embassy_stm32::adc::SampleTime;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, bind_interrupts, peripherals, rng};

pub(super) use embassy_stm32::peripherals::{ADC1 as TemperatureAdc, CAN1, CAN2};

bind_interrupts!(pub(super) struct RandomInterrupt {
    RNG => rng::InterruptHandler<peripherals::RNG>;
});

/// What only this board has in its place: the pin of LD2, blue, and the ADC of the temperature sensor.
macro_rules! own {
    ($peripherals:ident) => {
        Own { ld2: $peripherals.PB7.into(), adc: $peripherals.ADC1 }
    };
}
pub(super) use own;

/// Where the chip has the conversions of its temperature sensor at 30 and at 110 degrees Celsius (data sheet).
pub(super) const CALIBRATION: [usize; 2] = [0x1FF0_F44C, 0x1FF0_F44E];
/// 18 µs at 27 MHz; the sensor needs 10.
pub(super) const SAMPLE: SampleTime = SampleTime::CYCLES480;

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

/// Switches the instruction cache on, for flash has wait states; the data cache stays off: see net.rs. All memory is
/// always clocked here.
pub(super) fn prepare(core: &mut cortex_m::Peripherals) {
    core.SCB.enable_icache();
}
