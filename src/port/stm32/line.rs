//! An RS-485 line: a USART, and the transceiver's driver-enable pin.

use core::future::poll_fn;
use core::task::Poll;

use embassy_stm32::gpio::Pull;
use embassy_stm32::pac::usart::Usart;
use embassy_stm32::usart::{self, BufferedUart, Config, ConfigError, DataBits, StopBits};
use embedded_io_async::{BufRead, ErrorType, Read, Write};
use puente_line::{Parity, Settings};

use super::driver_enable::DriverEnable;
use super::receiver::{Error, Receiver};
use super::registers;
use super::transmitter::Transmitter;
#[cfg(feature = "test-hooks")]
use crate::port::embedded::hooks;
use crate::port::{LineReader, LineWriter, SerialLine};

/// Characters received and not yet read.
pub(super) const RECEIVE: usize = 1024;

/// Where embassy's driver keeps characters. It needs one to send, and has none: see [`Transmitter`].
pub(super) struct Buffers {
    pub sent: &'static mut [u8; 1],
    pub received: &'static mut [u8; RECEIVE],
}

/// An open line.
pub struct Line {
    uart: BufferedUart<'static>,
    usart: Usart,
    driver: &'static DriverEnable,
    receiver: &'static Receiver,
    transmitter: &'static Transmitter,
    /// Bits that are data.
    data: u8,
}

/// The driver's settings. It adds the parity bit to the word length itself, as the hardware counts it.
pub(in crate::port) fn config(settings: Settings) -> Result<Config, ConfigError> {
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
    // The driver wakes the reader at a pause of a character; `Receiver` does it where it waits for no more.
    config.eager_reads = None;
    // A transceiver lets go of RO while it transmits where /RE is tied to DE.
    config.rx_pull = Pull::Up;
    Ok(config)
}

impl SerialLine for Line {
    type Error = Error;
    type Reader<'a> = Reader<'a>;
    type Writer<'a> = Writer<'a>;

    fn split(&mut self) -> (Reader<'_>, Writer<'_>) {
        let Self { uart, usart, driver, receiver, transmitter, data } = self;
        (Reader { uart, usart: *usart, receiver, data: *data }, Writer { usart: *usart, driver, transmitter })
    }
}

/// The receiving half.
pub struct Reader<'a> {
    uart: &'a mut BufferedUart<'static>,
    usart: Usart,
    receiver: &'static Receiver,
    data: u8,
}

impl ErrorType for Reader<'_> {
    type Error = Error;
}

impl Read for Reader<'_> {
    /// Waits for characters. An error comes before the characters that it spoilt, which the next call returns.
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
        #[cfg(feature = "test-hooks")]
        hooks::reading();
        // Not consumed until copied, so that nothing is lost where this future is dropped or an error goes first.
        let ready = poll_fn(|context| {
            self.receiver.register(context.waker());
            Poll::Ready(())
        });
        ready.await;
        let received = self.uart.fill_buf().await.map_err(|_| Error::Overrun)?;
        if let Some(error) = self.receiver.take_error() {
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

impl LineReader for Reader<'_> {
    fn expect(&mut self, count: usize) {
        self.receiver.expect(count);
    }

    fn carrier(&self) -> bool {
        registers::is_receiving(self.usart)
    }
}

/// The sending half.
pub struct Writer<'a> {
    usart: Usart,
    driver: &'static DriverEnable,
    transmitter: &'a Transmitter,
}

impl ErrorType for Writer<'_> {
    type Error = Error;
}

impl Write for Writer<'_> {
    async fn write(&mut self, characters: &[u8]) -> Result<usize, Error> {
        #[cfg(feature = "test-hooks")]
        hooks::writing().await;
        if characters.is_empty() {
            return Ok(0);
        }
        loop {
            let raised = if self.transmitter.is_sending() { None } else { Some(self.driver.raise().await) };
            let taken = poll_fn(|context| {
                self.transmitter.take(self.usart, context.waker(), characters, raised.is_some())
            });
            // None where the line has become free meanwhile.
            if let Some(length) = taken.await {
                if let Some(raised) = raised {
                    raised.sent();
                }
                return Ok(length);
            }
        }
    }

    /// Waits until the last stop bit is on the line.
    async fn flush(&mut self) -> Result<(), Error> {
        poll_fn(|context| self.transmitter.ended(context.waker()).map(Ok)).await
    }
}

impl LineWriter for Writer<'_> {
    fn discard(&mut self) {
        self.transmitter.discard(self.usart);
    }
}

/// One USART and its pins, ready to become a [`Line`].
macro_rules! rs485 {
    ($module:ident, $usart:ident, tx $tx:ident, rx $rx:ident, de $de:ident, $priority:ident) => {
        pub mod $module {
            use embassy_stm32::interrupt::typelevel::{self, Handler};
            use embassy_stm32::interrupt::{InterruptExt, Priority};
            use embassy_stm32::peripherals::{$de, $rx, $tx, $usart};
            use embassy_stm32::usart::{BufferedInterruptHandler, ConfigError};
            use embassy_stm32::{Peri, bind_interrupts, interrupt, pac};
            use puente_line::Settings;
            use static_cell::ConstStaticCell;

            use super::{Buffers, DriverEnable, Line, RECEIVE, Receiver, Transmitter, config, registers};

            static RECEIVER: Receiver = Receiver::new();
            static TRANSMITTER: Transmitter = Transmitter::new();
            static DRIVER: DriverEnable = DriverEnable::new();
            static SENT: ConstStaticCell<[u8; 1]> = ConstStaticCell::new([0]);
            static RECEIVED: ConstStaticCell<[u8; RECEIVE]> = ConstStaticCell::new([0; RECEIVE]);

            /// Runs before embassy's handler, which clears the flags.
            struct Before;

            impl Handler<typelevel::$usart> for Before {
                unsafe fn on_interrupt() {
                    RECEIVER.arriving(registers::arrival(pac::$usart));
                    TRANSMITTER.interrupting(pac::$usart);
                }
            }

            /// Runs after it.
            struct After;

            impl Handler<typelevel::$usart> for After {
                unsafe fn on_interrupt() {
                    if TRANSMITTER.interrupted(pac::$usart) {
                        DRIVER.lower();
                    }
                    RECEIVER.arrived();
                }
            }

            bind_interrupts!(struct Interrupts {
                $usart => Before, BufferedInterruptHandler<$usart>, After;
            });

            /// The USART and its pins.
            pub struct Parts {
                pub(in crate::port) usart: Peri<'static, $usart>,
                pub(in crate::port) tx: Peri<'static, $tx>,
                pub(in crate::port) rx: Peri<'static, $rx>,
                pub(in crate::port) de: Peri<'static, $de>,
            }

            impl Parts {
                /// Opens the line. Refuses a baud rate or format that the USART cannot do.
                pub fn open(self, settings: Settings) -> Result<Line, ConfigError> {
                    interrupt::$usart.set_priority(Priority::$priority);
                    let buffers = Buffers { sent: SENT.take(), received: RECEIVED.take() };
                    let config = config(settings)?;
                    let uart =
                        DRIVER.open(self.usart, (self.rx, self.tx, self.de), Interrupts, buffers, config)?;
                    // With 7 data bits and parity the receiver leaves the parity bit above them.
                    let data = if settings.format.data_bits == 7 { 0x7F } else { 0xFF };
                    let (receiver, transmitter) = (&RECEIVER, &TRANSMITTER);
                    Ok(Line { uart, usart: pac::$usart, driver: &DRIVER, receiver, transmitter, data })
                }
            }
        }
    };
}

// Above everything: F4 and F7 have room for one character only.
#[cfg(network)]
rs485!(a, USART2, tx PD5, rx PD6, de PD4, P0);
#[cfg(network)]
rs485!(b, UART7, tx PE8, rx PE7, de PE9, P0);
// Below the loop of the axis, for G4 has a FIFO.
#[cfg(feature = "nucleo-g474re")]
rs485!(c, USART1, tx PC4, rx PC5, de PA12, P1);
