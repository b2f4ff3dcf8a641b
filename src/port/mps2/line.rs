//! A serial line: a CMSDK UART. QEMU gives its characters no time, so a timer ticks once a character while there are
//! any, and each tick takes and gives one. The rest is done as on the Nucleo boards: interrupts move characters between
//! the UART and buffers in memory.

use core::cell::RefCell;
use core::convert::Infallible;
use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::AtomicWaker;
use embedded_io_async::{ErrorType, Read, Write};
use heapless::Deque;
use puente_line::Settings;

use super::interrupt::{Interrupt, enable};
use super::pacer::{LINE_A, LINE_B, Pacer};
use super::registers::uart::{
    BAUD_DIVIDER, CONTROL, DATA, INTERRUPT_CLEAR, LEAST_DIVIDER, RECEIVE_FULL, STATE, TRANSMIT_FULL,
};
use super::registers::{self, Registers};
#[cfg(feature = "test-hooks")]
use crate::port::embedded::hooks;
use crate::port::{LineReader, LineWriter, SerialLine};

/// Control: transmitter and receiver,
const ON: u32 = 0b0011;
/// and an interrupt for a character that has come in.
const LISTENING: u32 = ON | 0b1000;
const CLOCK: u32 = 25_000_000;

/// Characters taken and not yet sent: a Modbus ASCII frame has 513.
const TRANSMIT: usize = 520;
/// So many are left when the writer is told that there is room.
const FEW: usize = TRANSMIT / 2;
/// Characters received and not yet read.
const RECEIVE: usize = 1024;

/// What is between the line and the UART.
struct Buffers {
    outgoing: Deque<u8, TRANSMIT>,
    incoming: Deque<u8, RECEIVE>,
    /// So many of them wake the reader, or a pause after fewer.
    expected: usize,
    /// The last character that went out has had no time yet.
    sending: bool,
    /// The timer ticks.
    ticking: bool,
}

/// A UART and who waits for it.
pub(super) struct Uart {
    registers: Registers,
    pacer: Pacer,
    interrupts: [Interrupt; 2],
    buffers: Mutex<CriticalSectionRawMutex, RefCell<Buffers>>,
    reader: AtomicWaker,
    writer: AtomicWaker,
}

pub(super) static UART1: Uart =
    Uart::new(registers::UART1, LINE_A, [Interrupt::Uart1Receive, Interrupt::Timer1]);
pub(super) static UART2: Uart =
    Uart::new(registers::UART2, LINE_B, [Interrupt::Uart2Receive, Interrupt::DualTimer]);

impl Uart {
    const fn new(registers: Registers, pacer: Pacer, interrupts: [Interrupt; 2]) -> Self {
        let buffers = Buffers {
            outgoing: Deque::new(),
            incoming: Deque::new(),
            expected: 1,
            sending: false,
            ticking: false,
        };
        Self {
            registers,
            pacer,
            interrupts,
            buffers: Mutex::new(RefCell::new(buffers)),
            reader: AtomicWaker::new(),
            writer: AtomicWaker::new(),
        }
    }

    fn with<R>(&self, f: impl FnOnce(&mut Buffers) -> R) -> R {
        self.buffers.lock(|buffers| f(&mut buffers.borrow_mut()))
    }

    /// A character has come in while there were none. Those that follow have to wait for their time.
    pub(super) fn received(&self) {
        self.registers.write(INTERRUPT_CLEAR, 0b11);
        self.with(|buffers| {
            self.take(buffers, self.registers.read(STATE));
            self.tick_on(buffers);
        });
    }

    /// The time of a character is over.
    pub(super) fn ticked(&self) {
        self.pacer.clear();
        self.with(|buffers| {
            let state = self.registers.read(STATE);
            let received = self.take(buffers, state);
            if !received && !buffers.incoming.is_empty() {
                self.reader.wake();
            }
            let sent = state & TRANSMIT_FULL == 0;
            if sent {
                self.send(buffers);
            }
            if !received && sent && !buffers.sending {
                buffers.ticking = false;
                self.pacer.stop();
                self.registers.write(CONTROL, LISTENING);
                // No interrupt tells of one that has come in just before.
                if self.take(buffers, self.registers.read(STATE)) {
                    self.tick_on(buffers);
                }
            }
        });
    }

    /// Takes a character, where the UART's state says that there is one.
    fn take(&self, buffers: &mut Buffers, state: u32) -> bool {
        let received = state & RECEIVE_FULL != 0;
        if received {
            // Where there is no room it is lost, as characters are that nobody fetches.
            let _ = buffers.incoming.push_back(self.registers.read(DATA) as u8);
            if buffers.incoming.len() >= buffers.expected {
                self.reader.wake();
            }
        }
        received
    }

    /// Gives the UART the next character, where there is one.
    fn send(&self, buffers: &mut Buffers) {
        let next = buffers.outgoing.pop_front();
        if let Some(character) = next {
            self.registers.write(DATA, u32::from(character));
        }
        let sent = next.is_none() && buffers.sending;
        if sent || buffers.outgoing.len() == FEW {
            self.writer.wake();
        }
        buffers.sending = next.is_some();
    }

    /// From now on there is a tick for each character, until there are no more.
    fn tick_on(&self, buffers: &mut Buffers) {
        if !buffers.ticking {
            buffers.ticking = true;
            self.registers.write(CONTROL, ON);
            self.pacer.run();
        }
    }
}

/// An open line.
pub struct Line {
    uart: &'static Uart,
    /// Bits that are data.
    mask: u8,
}

impl Line {
    /// Opens a UART. The format counts for the time of a character only: QEMU carries whole bytes.
    pub(super) fn new(uart: &'static Uart, settings: Settings) -> Self {
        let divider = CLOCK / settings.baud.max(1);
        uart.registers.write(BAUD_DIVIDER, divider.max(LEAST_DIVIDER));
        uart.registers.write(CONTROL, LISTENING);
        uart.pacer.set(settings.wire_time(1));
        uart.interrupts.into_iter().for_each(enable);
        Self { uart, mask: if settings.format.data_bits == 7 { 0x7F } else { 0xFF } }
    }
}

impl SerialLine for Line {
    type Error = Infallible;
    type Reader<'a> = Reader<'a>;
    type Writer<'a> = Writer<'a>;

    fn split(&mut self) -> (Reader<'_>, Writer<'_>) {
        (Reader(self), Writer(self))
    }
}

/// The receiving half.
pub struct Reader<'a>(&'a Line);

impl ErrorType for Reader<'_> {
    type Error = Infallible;
}

impl Read for Reader<'_> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        #[cfg(feature = "test-hooks")]
        hooks::reading();
        let Line { uart, mask } = self.0;
        poll_fn(|context| {
            uart.reader.register(context.waker());
            let length = uart.with(|buffers| {
                let received = core::iter::from_fn(|| buffers.incoming.pop_front());
                buffer.iter_mut().zip(received).map(|(to, from)| *to = from & mask).count()
            });
            if length == 0 && !buffer.is_empty() { Poll::Pending } else { Poll::Ready(Ok(length)) }
        })
        .await
    }
}

impl LineReader for Reader<'_> {
    fn expect(&mut self, count: usize) {
        self.0.uart.with(|buffers| buffers.expected = count.min(RECEIVE / 2));
    }

    /// What the computer may take that emulates the board.
    fn latency(&self) -> puente_line::Duration {
        puente_line::Duration::from_millis(10)
    }
}

/// The sending half.
pub struct Writer<'a>(&'a Line);

impl ErrorType for Writer<'_> {
    type Error = Infallible;
}

impl Write for Writer<'_> {
    async fn write(&mut self, characters: &[u8]) -> Result<usize, Infallible> {
        #[cfg(feature = "test-hooks")]
        hooks::writing().await;
        let Line { uart, mask } = self.0;
        poll_fn(|context| {
            uart.writer.register(context.waker());
            uart.with(|buffers| {
                if buffers.outgoing.len() > FEW {
                    return Poll::Pending;
                }
                let room = TRANSMIT - buffers.outgoing.len();
                let piece = characters.get(..room).unwrap_or(characters);
                buffers.outgoing.extend(piece.iter().map(|character| character & mask));
                if !buffers.ticking {
                    uart.send(buffers);
                }
                uart.tick_on(buffers);
                Poll::Ready(Ok(piece.len()))
            })
        })
        .await
    }

    /// Waits until the last stop bit would be on the line.
    async fn flush(&mut self) -> Result<(), Infallible> {
        let uart = self.0.uart;
        poll_fn(|context| {
            uart.writer.register(context.waker());
            let quiet = uart.with(|buffers| buffers.outgoing.is_empty() && !buffers.sending);
            if quiet { Poll::Ready(Ok(())) } else { Poll::Pending }
        })
        .await
    }
}

impl LineWriter for Writer<'_> {
    fn discard(&mut self) {
        self.0.uart.with(|buffers| buffers.outgoing.clear());
    }
}
