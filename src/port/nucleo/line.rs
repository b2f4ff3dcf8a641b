//! An RS-485 line: a USART, and the transceiver's driver-enable pin.

use core::sync::atomic::{AtomicU8, Ordering};

use embassy_stm32::gpio::Pull;
use embassy_stm32::usart::{self, BufferedUart, Config, ConfigError, DataBits, StopBits};
use embedded_io_async::{BufRead, ErrorKind, ErrorType, Read, Write};
use puente_line::{Parity, Settings};

use super::driver_enable::DriverEnable;
#[cfg(feature = "test-hooks")]
use crate::port::embedded::hooks;

/// Longest frame that goes out in one piece: a Modbus ASCII frame has 513 characters.
pub(super) const TRANSMIT: usize = 520;
/// Characters received and not yet read.
pub(super) const RECEIVE: usize = 1024;

/// Where a USART keeps characters.
pub(super) struct Buffers {
    pub sent: &'static mut [u8; TRANSMIT],
    pub received: &'static mut [u8; RECEIVE],
}

/// What is wrong with a received character.
pub(super) struct Spoilt {
    pub overrun: bool,
    pub framing: bool,
    pub parity: bool,
}

/// Why received characters are not to be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// Characters came faster than they were fetched, and some are lost.
    Overrun,
    /// No stop bit where one was due: noise, a collision, or another baud rate or format.
    Framing,
    /// The parity bit does not match.
    Parity,
}

impl core::fmt::Display for Error {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Error::Overrun => "characters were lost",
            Error::Framing => "a character had no stop bit",
            Error::Parity => "a character had the wrong parity",
        })
    }
}

impl core::error::Error for Error {}

impl embedded_io_async::Error for Error {
    fn kind(&self) -> ErrorKind {
        ErrorKind::InvalidData
    }
}

/// Errors that the receiver saw, kept until somebody reads. embassy's driver drops them and passes the spoilt
/// character on as a good one, so a handler of our own looks first.
pub(super) struct Errors(AtomicU8);

impl Errors {
    const OVERRUN: u8 = 1;
    const FRAMING: u8 = 2;
    const PARITY: u8 = 4;

    pub(super) const fn new() -> Self {
        Self(AtomicU8::new(0))
    }

    pub(super) fn keep(&self, spoilt: Spoilt) {
        let flag = |set, bit| if set { bit } else { 0 };
        let seen = flag(spoilt.overrun, Self::OVERRUN)
            | flag(spoilt.framing, Self::FRAMING)
            | flag(spoilt.parity, Self::PARITY);
        if seen != 0 {
            self.0.fetch_or(seen, Ordering::Relaxed);
        }
    }

    /// The worst error since the last call.
    fn take(&self) -> Option<Error> {
        match self.0.swap(0, Ordering::Relaxed) {
            0 => None,
            seen if seen & Self::OVERRUN != 0 => Some(Error::Overrun),
            seen if seen & Self::FRAMING != 0 => Some(Error::Framing),
            _ => Some(Error::Parity),
        }
    }
}

/// An open line.
pub struct Line {
    uart: BufferedUart<'static>,
    driver: &'static DriverEnable,
    errors: &'static Errors,
    /// Bits that are data: with 7 data bits and parity the receiver leaves the parity bit above them.
    data: u8,
}

impl Line {
    pub(super) fn new(
        uart: BufferedUart<'static>,
        driver: &'static DriverEnable,
        errors: &'static Errors,
        settings: Settings,
    ) -> Self {
        let data = if settings.format.data_bits == 7 { 0x7F } else { 0xFF };
        Self { uart, driver, errors, data }
    }
}

/// The driver's settings. It adds the parity bit to the word length itself, as the hardware counts it.
pub(super) fn config(settings: Settings) -> Result<Config, ConfigError> {
    let mut config = Config::default();
    config.baudrate = settings.baud.max(1);
    config.data_bits = match settings.format.data_bits {
        7 => DataBits::DataBits7,
        8 => DataBits::DataBits8,
        _ => return Err(ConfigError::DataParityNotSupported),
    };
    config.parity = match settings.format.parity {
        Parity::None => usart::Parity::ParityNone,
        Parity::Even => usart::Parity::ParityEven,
        Parity::Odd => usart::Parity::ParityOdd,
    };
    config.stop_bits = match settings.format.stop_bits {
        2 => StopBits::STOP2,
        _ => StopBits::STOP1,
    };
    // Every character wakes the reader: frames that end by length are answered at once, and the times are exact.
    config.eager_reads = Some(1);
    // A transceiver lets go of RO while it transmits where /RE is tied to DE.
    config.rx_pull = Pull::Up;
    Ok(config)
}

impl ErrorType for Line {
    type Error = Error;
}

impl Read for Line {
    /// Waits for characters. An error comes before the characters that it spoilt, which the next call returns.
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        #[cfg(feature = "test-hooks")]
        hooks::reading();
        // Not consumed until copied, so that nothing is lost where this future is dropped or an error goes first.
        let received = self.uart.fill_buf().await.map_err(|_| Error::Overrun)?;
        if let Some(error) = self.errors.take() {
            return Err(error);
        }
        let mut length = 0;
        for (to, from) in buffer.iter_mut().zip(received) {
            *to = from & self.data;
            length += 1;
        }
        self.uart.consume(length);
        Ok(length)
    }
}

impl Write for Line {
    /// Waits until the line is quiet, then starts to send up to a whole frame.
    async fn write(&mut self, characters: &[u8]) -> Result<usize, Error> {
        // embassy's driver never completes a write of nothing, nor one that finds its buffer partly full.
        if characters.is_empty() {
            return Ok(0);
        }
        #[cfg(feature = "test-hooks")]
        hooks::writing().await;
        self.flush().await?;
        let piece = characters.get(..TRANSMIT).unwrap_or(characters);
        let raised = self.driver.raise().await;
        let length = Write::write(&mut self.uart, piece).await.map_err(|_| Error::Overrun)?;
        raised.sent();
        Ok(length)
    }

    /// Waits until the last stop bit is on the line.
    async fn flush(&mut self) -> Result<(), Error> {
        Write::flush(&mut self.uart).await.map_err(|_| Error::Overrun)
    }
}

impl crate::port::SerialLine for Line {}

/// One USART and its pins, ready to become a [`Line`].
macro_rules! rs485 {
    ($module:ident, $usart:ident, tx $tx:ident, rx $rx:ident, de $de:ident) => {
        pub mod $module {
            use embassy_stm32::interrupt::typelevel::{self, Handler};
            use embassy_stm32::interrupt::{InterruptExt, Priority};
            use embassy_stm32::peripherals::{$de, $rx, $tx, $usart};
            use embassy_stm32::usart::{BufferedInterruptHandler, ConfigError};
            use embassy_stm32::{Peri, bind_interrupts, interrupt, pac};
            use puente_line::Settings;
            use static_cell::ConstStaticCell;

            use super::{Buffers, DriverEnable, Errors, Line, RECEIVE, TRANSMIT, config};

            static ERRORS: Errors = Errors::new();
            static DRIVER: DriverEnable = DriverEnable::new();
            static SENT: ConstStaticCell<[u8; TRANSMIT]> = ConstStaticCell::new([0; TRANSMIT]);
            static RECEIVED: ConstStaticCell<[u8; RECEIVE]> = ConstStaticCell::new([0; RECEIVE]);

            /// Runs before embassy's handler, which clears the flags.
            struct Before;

            impl Handler<typelevel::$usart> for Before {
                unsafe fn on_interrupt() {
                    ERRORS.keep(DRIVER.before(pac::$usart));
                }
            }

            /// Runs after it.
            struct After;

            impl Handler<typelevel::$usart> for After {
                unsafe fn on_interrupt() {
                    DRIVER.after(pac::$usart);
                }
            }

            bind_interrupts!(struct Interrupts {
                $usart => Before, BufferedInterruptHandler<$usart>, After;
            });

            /// The USART and its pins.
            pub struct Parts {
                pub(in crate::port::nucleo) usart: Peri<'static, $usart>,
                pub(in crate::port::nucleo) tx: Peri<'static, $tx>,
                pub(in crate::port::nucleo) rx: Peri<'static, $rx>,
                pub(in crate::port::nucleo) de: Peri<'static, $de>,
            }

            impl Parts {
                /// Opens the line. Refuses a baud rate or format that the USART cannot do.
                pub fn open(self, settings: Settings) -> Result<Line, ConfigError> {
                    // Above everything: F4 and F7 have room for one character only.
                    interrupt::$usart.set_priority(Priority::P0);
                    let buffers = Buffers { sent: SENT.take(), received: RECEIVED.take() };
                    let config = config(settings)?;
                    let uart =
                        DRIVER.open(self.usart, (self.rx, self.tx, self.de), Interrupts, buffers, config)?;
                    Ok(Line::new(uart, &DRIVER, &ERRORS, settings))
                }
            }
        }
    };
}

rs485!(a, USART2, tx PD5, rx PD6, de PD4);
rs485!(b, UART7, tx PE8, rx PE7, de PE9);
