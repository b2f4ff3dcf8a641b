//! The encoder.

use embassy_stm32::gpio::{AfType, AnyPin, Flex, Input, OutputType, Pull, Speed};
use embassy_stm32::pac::spi::vals::{Cpha, Cpol, Mstr};
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, FilterValue, Sms};
use embassy_stm32::peripherals::{PA0, PA1, PC10, PC11, SPI3, TIM2};
use embassy_stm32::{Peri, pac, rcc};
use puente_drives::pid::{EncoderFault, Width, ssi};

/// TIM2's status: both lines changed at once, TERRF (RM0440, TIMx_SR bit 23).
const TRANSITION_ERROR: u32 = 1 << 23;

/// Where a sample comes from.
pub(super) enum Encoder {
    /// TIM2 counts all edges of A and B.
    Quadrature { _lines: [Flex<'static>; 2] },
    /// Sixteen pins.
    Parallel { width: Width, _pins: [Input<'static>; 16] },
    /// SPI3 clocks, and takes what the encoder says.
    Ssi(Ssi),
}

impl Encoder {
    pub fn quadrature(_: Peri<'static, TIM2>, a: Peri<'static, PA0>, b: Peri<'static, PA1>) -> Self {
        /// TIM2_CH1 and TIM2_CH2 (data sheet, table of alternate functions).
        const FUNCTION: u8 = 1;
        rcc::enable_and_reset::<TIM2>();
        let timer = pac::TIM2;
        timer.ccmr_input(0).write(|inputs| {
            for channel in 0..2 {
                inputs.set_ccs(channel, CcmrInputCcs::TI4);
                // What is shorter than 8 clocks, 47 ns, is none.
                inputs.set_icf(channel, FilterValue::FCK_INT_N8);
            }
        });
        timer.smcr().write(|mode| mode.set_sms(Sms::ENCODER_MODE_3));
        timer.arr().write_value(u32::MAX);
        let line = |mut line: Flex<'static>| {
            line.set_as_af_unchecked(FUNCTION, AfType::input(Pull::Up));
            line
        };
        let lines = [line(Flex::new(a)), line(Flex::new(b))];
        timer.cr1().write(|control| control.set_cen(true));
        Self::Quadrature { _lines: lines }
    }

    /// The pins of bit 0 to 15.
    pub fn parallel(width: Width, pins: [Peri<'static, AnyPin>; 16]) -> Self {
        Self::Parallel { width, _pins: pins.map(|pin| Input::new(pin, Pull::Down)) }
    }

    pub fn ssi(
        format: ssi::Format,
        _: Peri<'static, SPI3>,
        clock: Peri<'static, PC10>,
        data: Peri<'static, PC11>,
    ) -> Self {
        Self::Ssi(Ssi::new(format, Flex::new(clock), Flex::new(data)))
    }

    pub fn sample(&mut self) -> Result<u32, EncoderFault> {
        match self {
            Self::Quadrature { .. } => count(),
            Self::Parallel { width, .. } => Ok(code() & width.max()),
            Self::Ssi(ssi) => ssi.sample(),
        }
    }
}

fn count() -> Result<u32, EncoderFault> {
    let status = pac::TIM2.sr();
    if status.read().0 & TRANSITION_ERROR != 0 {
        // A flag that is written as 1 stays as it is.
        status.write(|flags| flags.0 = !TRANSITION_ERROR);
        return Err(EncoderFault::Edges);
    }
    Ok(pac::TIM2.cnt().read())
}

/// Bits 0 to 3 are PC0 to PC3, bits 4 to 10 PC6 to PC12, bits 11 to 15 PB11 to PB15. Between the two reads a Gray code
/// changes in one bit at most.
fn code() -> u32 {
    let (b, c) = (pac::GPIOB.idr().read().0, pac::GPIOC.idr().read().0);
    c & 0x000F | c >> 2 & 0x07F0 | b & 0xF800
}

/// An SSI encoder. Each sample takes the answer to the clocks of the last one and starts the next, so that it is as old as
/// a period of the loop.
///
/// The line rests high, and is sampled at the falling edges of the clock: the first one holds the code in the encoder and
/// sees the line at rest, each rising edge shifts a bit out.
pub(super) struct Ssi {
    format: ssi::Format,
    /// Bits of each of the two words.
    word: u8,
    _pins: [Flex<'static>; 2],
}

impl Ssi {
    fn new(format: ssi::Format, mut clock: Flex<'static>, mut data: Flex<'static>) -> Self {
        /// SPI3_SCK and SPI3_MISO (data sheet, table of alternate functions).
        const FUNCTION: u8 = 6;
        // Two words of more than 8 bits fill the FIFOs. Clocks beyond the answer do no harm: an encoder that begins anew
        // then is read no further.
        let word = format.samples().div_ceil(2).clamp(9, 16);
        clock.set_as_af_unchecked(FUNCTION, AfType::output(OutputType::PushPull, Speed::Low));
        data.set_as_af_unchecked(FUNCTION, AfType::input(Pull::Up));
        rcc::enable_and_reset::<SPI3>();
        let spi = pac::SPI3;
        spi.cr2().write(|control| control.set_ds(pac::spi::vals::Ds::from_bits(word - 1)));
        spi.cr1().write(|control| {
            control.set_mstr(Mstr::MASTER);
            control.set_ssm(true);
            control.set_ssi(true);
            // 664 kHz: an answer of 32 bits takes 48 µs, and leaves the encoder as long to rest.
            control.set_br(pac::spi::vals::Br::DIV256);
            control.set_cpol(Cpol::IDLE_HIGH);
            control.set_cpha(Cpha::FIRST_EDGE);
            control.set_spe(true);
        });
        Self { format, word, _pins: [clock, data] }
    }

    fn sample(&mut self) -> Result<u32, EncoderFault> {
        let spi = pac::SPI3;
        let mut words = 0;
        let mut line = 0_u64;
        while spi.sr().read().rxne() && words < 2 {
            line = line << self.word | u64::from(spi.dr16().read());
            words += 1;
        }
        if spi.sr().read().bsy() {
            return Err(EncoderFault::Line);
        }
        for _ in 0..2 {
            spi.dr16().write_value(0);
        }
        if words < 2 {
            return Err(EncoderFault::Unread);
        }
        let beyond = 2 * self.word - self.format.samples().min(2 * self.word);
        self.format.decode(line >> beyond)
    }
}
