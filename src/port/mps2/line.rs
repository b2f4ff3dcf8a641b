//! A serial line: a CMSDK UART. QEMU gives its characters no time, so the line itself keeps to the baud rate.

use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{ErrorType, Read, Write};
use puente_line::Settings;

use super::interrupt::{Interrupt, enable};
use super::registers::{self, Registers};
#[cfg(feature = "test-hooks")]
use crate::port::embedded::hooks;

const DATA: usize = 0x00;
const STATE: usize = 0x04;
const CONTROL: usize = 0x08;
const INTERRUPT_CLEAR: usize = 0x0C;
const BAUD_DIVIDER: usize = 0x10;

/// State: the one character that there is room for has not gone out yet.
const TRANSMIT_FULL: u32 = 0b01;
/// State: a character has come in.
const RECEIVE_FULL: u32 = 0b10;
/// Control: transmitter and receiver, each with its interrupt.
const ENABLE: u32 = 0b1111;
/// The least that the transmitter works with.
const LEAST_DIVIDER: u32 = 16;
const CLOCK: u32 = 25_000_000;

/// A UART and who waits for it.
pub(super) struct Uart {
    registers: Registers,
    interrupts: [Interrupt; 2],
    reader: AtomicWaker,
    writer: AtomicWaker,
}

pub(super) static UART1: Uart =
    Uart::new(registers::UART1, [Interrupt::Uart1Receive, Interrupt::Uart1Transmit]);
pub(super) static UART2: Uart =
    Uart::new(registers::UART2, [Interrupt::Uart2Receive, Interrupt::Uart2Transmit]);

impl Uart {
    const fn new(registers: Registers, interrupts: [Interrupt; 2]) -> Self {
        Self { registers, interrupts, reader: AtomicWaker::new(), writer: AtomicWaker::new() }
    }

    /// Either interrupt: somebody may go on. A character that nobody fetches raises none again.
    pub(super) fn interrupted(&self) {
        self.registers.write(INTERRUPT_CLEAR, 0b11);
        self.reader.wake();
        self.writer.wake();
    }

    /// Waits until a character has come in.
    async fn received(&self) {
        poll_fn(|context| {
            self.reader.register(context.waker());
            self.ready(RECEIVE_FULL, RECEIVE_FULL)
        })
        .await
    }

    /// Waits until there is room for a character.
    async fn room(&self) {
        poll_fn(|context| {
            self.writer.register(context.waker());
            self.ready(TRANSMIT_FULL, 0)
        })
        .await
    }

    fn ready(&self, bit: u32, wanted: u32) -> Poll<()> {
        if self.registers.read(STATE) & bit == wanted { Poll::Ready(()) } else { Poll::Pending }
    }
}

/// An open line.
pub struct Line {
    uart: &'static Uart,
    /// Time of a character.
    character: Duration,
    /// Bits that are data.
    mask: u8,
    /// When the next character may be complete that comes in.
    complete: Instant,
    /// When the last character has gone out.
    free: Instant,
}

impl Line {
    /// Opens a UART. The format counts for the time of a character only: QEMU carries whole bytes.
    pub(super) fn new(uart: &'static Uart, settings: Settings) -> Self {
        let now = Instant::now();
        let divider = CLOCK / settings.baud.max(1);
        uart.registers.write(BAUD_DIVIDER, divider.max(LEAST_DIVIDER));
        uart.registers.write(CONTROL, ENABLE);
        uart.interrupts.into_iter().for_each(enable);
        Self {
            uart,
            character: Duration::from_micros(settings.wire_time(1).as_micros() as u64),
            mask: if settings.format.data_bits == 7 { 0x7F } else { 0xFF },
            complete: now,
            free: now,
        }
    }
}

impl ErrorType for Line {
    type Error = Infallible;
}

impl Read for Line {
    /// Waits for a character, and until the line could have carried it. QEMU keeps those that are to follow.
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let Some(to) = buffer.first_mut() else { return Ok(0) };
        #[cfg(feature = "test-hooks")]
        hooks::reading();
        self.uart.received().await;
        Timer::at(self.complete).await;
        // Nothing waits after this: a future that is dropped before has taken nothing.
        *to = self.uart.registers.read(DATA) as u8 & self.mask;
        self.complete = Instant::now() + self.character;
        Ok(1)
    }
}

impl Write for Line {
    /// Sends all of it, each character in its time.
    async fn write(&mut self, characters: &[u8]) -> Result<usize, Infallible> {
        #[cfg(feature = "test-hooks")]
        hooks::writing().await;
        for &character in characters {
            Timer::at(self.free).await;
            self.uart.room().await;
            self.uart.registers.write(DATA, u32::from(character & self.mask));
            self.free = Instant::now() + self.character;
        }
        Ok(characters.len())
    }

    /// Waits until the last stop bit would be on the line.
    async fn flush(&mut self) -> Result<(), Infallible> {
        Timer::at(self.free).await;
        Ok(())
    }
}

impl crate::port::SerialLine for Line {}
