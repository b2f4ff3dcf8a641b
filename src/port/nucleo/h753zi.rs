//! What only NUCLEO-H753ZI has (MB1364; NUCLEO-H743ZI2 is the same board with the same pins).

use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, bind_interrupts, pac, peripherals, rng};

pub(super) use embassy_stm32::peripherals::{FDCAN1 as CAN1, FDCAN2 as CAN2};

bind_interrupts!(pub(super) struct RandomInterrupt {
    HASH_RNG => rng::InterruptHandler<peripherals::RNG>;
});

/// The pin of LD2, yellow.
macro_rules! ld2 {
    ($peripherals:ident) => {
        $peripherals.PE1
    };
}
pub(super) use ld2;

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
