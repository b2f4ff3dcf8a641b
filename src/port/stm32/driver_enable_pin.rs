//! Driver-enable of a line, for a USART that has none: a pin that the software sets.
//!
//! It rises a bit time before the first start bit, at least. It falls in the interrupt of the last stop bit's end.
//! Nothing is more urgent than that interrupt; so it is late by what masks all interrupts or has the same priority:
//! the desk's and the clock's critical sections, a line of the log, the other line's interrupt.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Level, Output, Pin, Speed};
use embassy_stm32::interrupt::typelevel::Binding;
use embassy_stm32::usart::{
    BufferedInterruptHandler, BufferedUart, Config, ConfigError, Instance, RxPin, TxPin,
};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::Timer;

use super::line::Buffers;

/// The pin, which the line raises and its interrupt lowers.
pub(super) struct DriverEnable {
    pin: Mutex<CriticalSectionRawMutex, RefCell<Option<Output<'static>>>>,
    /// Time of a bit, in µs, rounded up.
    bit: AtomicU32,
}

impl DriverEnable {
    pub(super) const fn new() -> Self {
        Self { pin: Mutex::new(RefCell::new(None)), bit: AtomicU32::new(0) }
    }

    /// Takes the line, and waits until the transceiver drives it.
    pub(super) async fn raise(&'static self) -> Raised {
        let raised = Raised(self);
        self.set(Level::High);
        Timer::after_micros(u64::from(self.bit.load(Ordering::Relaxed))).await;
        raised
    }

    /// The line is free.
    pub(super) fn lower(&self) {
        self.set(Level::Low);
    }

    fn set(&self, level: Level) {
        self.pin.lock(|pin| {
            if let Some(pin) = pin.borrow_mut().as_mut() {
                pin.set_level(level);
            }
        });
    }

    /// Opens the USART.
    pub(super) fn open<T: Instance>(
        &'static self,
        usart: Peri<'static, T>,
        (rx, tx, de): (Peri<'static, impl RxPin<T>>, Peri<'static, impl TxPin<T>>, Peri<'static, impl Pin>),
        interrupts: impl Binding<T::Interrupt, BufferedInterruptHandler<T>> + 'static,
        buffers: Buffers,
        config: Config,
    ) -> Result<BufferedUart<'static>, ConfigError> {
        self.bit.store(1_000_000_u32.div_ceil(config.baudrate), Ordering::Relaxed);
        self.pin.lock(|pin| *pin.borrow_mut() = Some(Output::new(de, Level::Low, Speed::Low)));
        BufferedUart::new(usart, rx, tx, buffers.sent, buffers.received, interrupts, config)
    }
}

/// Characters may go out. The line is free again once they are out, or where none was sent.
pub(super) struct Raised(&'static DriverEnable);

impl Raised {
    /// They do.
    pub(super) fn sent(self) {
        core::mem::forget(self);
    }
}

impl Drop for Raised {
    fn drop(&mut self) {
        self.0.lower();
    }
}
