//! Driver-enable of a line, by the USART itself.

use embassy_stm32::Peri;
use embassy_stm32::interrupt::typelevel::Binding;
use embassy_stm32::usart::{
    BufferedInterruptHandler, BufferedUart, Config, ConfigError, DePin, Instance, RxPin, TxPin,
};

use super::line::Buffers;

/// How long driver-enable leads the first start bit, and how long it outlasts the last stop bit: 1 bit time (16/16).
/// A MAX3485-class driver needs a few microseconds at most; every Modbus slave waits 3.5 characters.
const MARGIN: u8 = 16;

/// Nothing is left to do for it.
pub(super) struct DriverEnable;

impl DriverEnable {
    pub(super) const fn new() -> Self {
        Self
    }

    pub(super) async fn raise(&'static self) -> Raised {
        Raised
    }

    pub(super) fn lower(&self) {}

    /// Opens the USART.
    pub(super) fn open<T: Instance>(
        &'static self,
        usart: Peri<'static, T>,
        (rx, tx, de): (
            Peri<'static, impl RxPin<T>>,
            Peri<'static, impl TxPin<T>>,
            Peri<'static, impl DePin<T>>,
        ),
        interrupts: impl Binding<T::Interrupt, BufferedInterruptHandler<T>> + 'static,
        buffers: Buffers,
        mut config: Config,
    ) -> Result<BufferedUart<'static>, ConfigError> {
        config.de_assertion_time = MARGIN;
        config.de_deassertion_time = MARGIN;
        BufferedUart::new_with_de(usart, rx, tx, de, interrupts, buffers.sent, buffers.received, config)
    }
}

/// Characters may go out.
pub(super) struct Raised;

impl Raised {
    /// They do.
    pub(super) fn sent(self) {}
}
