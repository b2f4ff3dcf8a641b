//! What only NUCLEO-H753ZI has (MB1364; NUCLEO-H743ZI2 is the same board with the same pins).

use embassy_stm32::adc::SampleTime;
use embassy_stm32::rcc::mux::{Adcsel, Fdcansel};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Config, bind_interrupts, pac, peripherals, rng};

pub(super) use embassy_stm32::peripherals::{ADC3 as TemperatureAdc, FDCAN1 as CAN1, FDCAN2 as CAN2};

bind_interrupts!(pub(super) struct RandomInterrupt {
    HASH_RNG => rng::InterruptHandler<peripherals::RNG>;
});

/// What only this board has in its place: the pin of LD2, yellow, the ADC of the temperature sensor, and the CAN
/// controllers.
macro_rules! own {
    ($peripherals:ident) => {
        Own {
            ld2: $peripherals.PE1.into(),
            adc: $peripherals.ADC3,
            can1: $peripherals.FDCAN1,
            can2: $peripherals.FDCAN2,
        }
    };
}
pub(super) use own;

/// Where the chip has the conversions of its temperature sensor at 30 and at 110 degrees Celsius (data sheet).
pub(super) const CALIBRATION: [usize; 2] = [0x1FF1_E820, 0x1FF1_E840];
/// 25 µs at 32 MHz; the sensor needs 9.
pub(super) const SAMPLE: SampleTime = SampleTime::CYCLES810_5;

/// 400 MHz processor, 200 MHz buses and Ethernet MAC, 100 MHz peripherals, 80 MHz for CAN, from the 8 MHz that the ST-LINK supplies.
pub(super) fn config() -> Config {
    let mut config = Config::default();
    let rcc = &mut config.rcc;
    rcc.hse = Some(Hse { freq: Hertz::mhz(8), mode: HseMode::Bypass });
    rcc.pll1 = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV2,
        mul: PllMul::MUL200,
        divp: Some(PllDiv::DIV2),
        divq: Some(PllDiv::DIV10),
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
    rcc.mux.fdcansel = Fdcansel::PLL1_Q;
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

/// Clock of the CAN controllers, in Hz.
pub(super) const CAN_CLOCK: u32 = 80_000_000;

/// Baud rates of the settings that the USARTs can do: all of them.
pub(super) const BAUD: core::ops::RangeInclusive<u32> = 300..=1_000_000;
/// They can do 7 data bits without parity.
pub(super) const SEVEN_BITS: bool = true;

/// Size of a sector. The last two are in bank 2; the image is in bank 1, so the processor goes on while they change.
pub(super) const SECTOR: usize = 128 * 1024;
/// Bytes that are read at once: those that have a checksum together.
pub(super) const FLASH_READ: usize = 32;

pub(super) fn flash_is_divided_as_known() -> bool {
    true
}

/// Reads whole words of flash. One that was being written or erased when the power went may be beyond correction, and
/// faults where it is read (RM0433, section 4.3.12); here it counts as zeros. Not tried on a board.
pub(super) fn read_flash(address: usize, bytes: &mut [u8]) {
    for (number, place) in bytes.chunks_exact_mut(FLASH_READ).enumerate() {
        let word = (address + number * FLASH_READ) as *const [u8; FLASH_READ];
        // SAFETY: the caller stays within the flash.
        place.copy_from_slice(&unsafe { read_word(word) }.unwrap_or([0; FLASH_READ]));
    }
}

/// A word of flash in bank 2, where it has its checksum.
///
/// # Safety
/// There must be such a word at this address.
unsafe fn read_word(word: *const [u8; FLASH_READ]) -> Option<[u8; FLASH_READ]> {
    /// CCR: code that runs above all faults is not disturbed by its own bus faults (Armv7-M, B3.2.8).
    const IGNORE_BUS_FAULTS: u32 = 1 << 8;
    /// CFSR: all traces of bus faults.
    const BUS_FAULTS: u32 = 0xFF << 8;
    let bank = pac::FLASH.bank(1);
    // SAFETY: its registers are those of the processor, and only this accesses these bits of them.
    let scb = unsafe { &*cortex_m::peripheral::SCB::PTR };
    // SAFETY: FAULTMASK is set for the time of a few reads, in thread mode, and the word is there to be read. Interrupts
    // wait so long, which is less than a character takes on any line.
    let bytes = unsafe {
        core::arch::asm!("cpsid f", "dsb", "isb");
        scb.ccr.modify(|flags| flags | IGNORE_BUS_FAULTS);
        cortex_m::asm::dsb();
        let bytes = word.read_volatile();
        cortex_m::asm::dsb();
        scb.cfsr.write(BUS_FAULTS);
        scb.ccr.modify(|flags| flags & !IGNORE_BUS_FAULTS);
        core::arch::asm!("cpsie f", "dsb", "isb");
        bytes
    };
    let status = bank.sr().read();
    // Left over, they would count as failures of the next writing.
    bank.ccr().write(|clear| {
        clear.set_clr_sneccerr(true);
        clear.set_clr_dbeccerr(true);
    });
    (!status.dbeccerr()).then_some(bytes)
}
