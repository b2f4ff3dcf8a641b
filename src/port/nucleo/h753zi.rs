//! What only NUCLEO-H753ZI has (MB1364; NUCLEO-H743ZI2 is the same board with the same pins).

use embassy_stm32::adc::SampleTime;
use embassy_stm32::rcc::mux::Adcsel;
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, bind_interrupts, pac, peripherals, rng};

pub(super) use embassy_stm32::peripherals::{ADC3 as TemperatureAdc, FDCAN1 as CAN1, FDCAN2 as CAN2};

bind_interrupts!(pub(super) struct RandomInterrupt {
    HASH_RNG => rng::InterruptHandler<peripherals::RNG>;
});

/// What only this board has in its place: the pin of LD2, yellow, and the ADC of the temperature sensor.
macro_rules! own {
    ($peripherals:ident) => {
        Own { ld2: $peripherals.PE1.into(), adc: $peripherals.ADC3 }
    };
}
pub(super) use own;

/// Where the chip has the conversions of its temperature sensor at 30 and at 110 degrees Celsius (data sheet).
pub(super) const CALIBRATION: [usize; 2] = [0x1FF1_E820, 0x1FF1_E840];
/// 25 µs at 32 MHz; the sensor needs 9.
pub(super) const SAMPLE: SampleTime = SampleTime::CYCLES810_5;

/// 400 MHz processor, 200 MHz buses and Ethernet MAC, 100 MHz peripherals, from the 8 MHz that the ST-LINK supplies.
pub(super) fn config() -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz::mhz(8), mode: HseMode::Bypass });
    rcc.pll1 = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV2,
        mul: PllMul::MUL200,
        divp: Some(PllDiv::DIV2),
        divq: None,
        divr: None,
    });
    // 400 MHz is the most that scale 1 allows; scale 0 would exclude chips before revision V.
    rcc.voltage_scale = VoltageScale::Scale1;
    rcc.sys = Sysclk::PLL1_P;
    rcc.ahb_pre = AHBPrescaler::DIV2;
    rcc.apb1_pre = APBPrescaler::DIV2;
    rcc.apb2_pre = APBPrescaler::DIV2;
    rcc.apb3_pre = APBPrescaler::DIV2;
    rcc.apb4_pre = APBPrescaler::DIV2;
    // The internal oscillator: the temperature sensor has nothing better to ask for.
    rcc.mux.adcsel = Adcsel::PER;
    config
}

/// Clocks SRAM1, which holds the Ethernet DMA's memory and is off after reset (RM0433, RCC_AHB2ENR), and switches the
/// instruction cache on, for flash has wait states. The data cache stays off: see net.rs.
pub(super) fn prepare(core: &mut cortex_m::Peripherals) {
    pac::RCC.ahb2enr().modify(|enable| enable.set_sram1en(true));
    // The bus needs two of its clocks before the first access; a read back waits for them.
    pac::RCC.ahb2enr().read();
    core.SCB.enable_icache();
}
