//! A UART without a line's manners: characters take no time, and none is lost. QEMU holds those back that find no room.
//!
//! It is an SLCAN adapter's: whoever reads is woken for whole lines, as a CAN controller would for frames.

use core::cell::RefCell;
use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::AtomicWaker;
use heapless::Deque;

use super::interrupt::{Interrupt, enable};
use super::registers::uart::{
    BAUD_DIVIDER, CONTROL, DATA, INTERRUPT_CLEAR, LEAST_DIVIDER, RECEIVE_FULL, STATE, TRANSMIT_FULL,
};
use super::registers::{self, Registers};
use crate::port::slcan::Wire;

/// Control: transmitter and receiver, with an interrupt for each character.
const ON: u32 = 0b1111;

/// What a line of an adapter ends with.
const ENDS: [u8; 2] = *b"\r\x07";

/// Characters received and not yet read.
const RECEIVE: usize = 512;
/// Characters taken and not yet sent.
const TRANSMIT: usize = 64;

struct Buffers {
    incoming: Deque<u8, RECEIVE>,
    outgoing: Deque<u8, TRANSMIT>,
}

/// A UART and who waits for it.
pub struct Uart {
    registers: Registers,
    interrupts: [Interrupt; 2],
    buffers: Mutex<CriticalSectionRawMutex, RefCell<Buffers>>,
    reader: AtomicWaker,
    writer: AtomicWaker,
}

pub(super) static UART3: Uart =
    Uart::new(registers::UART3, [Interrupt::Uart3Receive, Interrupt::Uart3Transmit]);
pub(super) static UART4: Uart =
    Uart::new(registers::UART4, [Interrupt::Uart4Receive, Interrupt::Uart4Transmit]);

impl Uart {
    const fn new(registers: Registers, interrupts: [Interrupt; 2]) -> Self {
        let buffers = Buffers { incoming: Deque::new(), outgoing: Deque::new() };
        Self {
            registers,
            interrupts,
            buffers: Mutex::new(RefCell::new(buffers)),
            reader: AtomicWaker::new(),
            writer: AtomicWaker::new(),
        }
    }

    /// Switches it on.
    pub(super) fn start(&self) {
        self.registers.write(BAUD_DIVIDER, LEAST_DIVIDER);
        self.registers.write(CONTROL, ON);
        self.interrupts.into_iter().for_each(enable);
    }

    fn with<R>(&self, f: impl FnOnce(&mut Buffers) -> R) -> R {
        self.buffers.lock(|buffers| f(&mut buffers.borrow_mut()))
    }

    /// A character has come in, or gone out.
    pub(super) fn interrupted(&self) {
        self.registers.write(INTERRUPT_CLEAR, 0b11);
        let (readable, writable) = self.with(|buffers| (self.take(buffers), self.send(buffers)));
        if readable {
            self.reader.wake();
        }
        if writable {
            self.writer.wake();
        }
    }

    /// Takes what has come in, as far as there is room. The rest stays where it is. True where a line has ended, or where
    /// there is no room for the rest of one.
    fn take(&self, buffers: &mut Buffers) -> bool {
        let mut ended = false;
        while !buffers.incoming.is_full() && self.registers.read(STATE) & RECEIVE_FULL != 0 {
            let character = self.registers.read(DATA) as u8;
            let _ = buffers.incoming.push_back(character);
            ended |= ENDS.contains(&character);
        }
        ended || buffers.incoming.is_full()
    }

    /// Sends as much as goes out at once. True where nothing is left.
    fn send(&self, buffers: &mut Buffers) -> bool {
        while self.registers.read(STATE) & TRANSMIT_FULL == 0 {
            let Some(character) = buffers.outgoing.pop_front() else { break };
            self.registers.write(DATA, u32::from(character));
        }
        buffers.outgoing.is_empty()
    }
}

impl Wire for &'static Uart {
    /// Whether there is anybody at the other end, QEMU does not tell.
    async fn open(&self) -> bool {
        true
    }

    async fn read(&self, buffer: &mut [u8]) -> Option<usize> {
        poll_fn(|context| {
            self.reader.register(context.waker());
            let length = self.with(|buffers| {
                let received = core::iter::from_fn(|| buffers.incoming.pop_front());
                let length = buffer.iter_mut().zip(received).map(|(to, from)| *to = from).count();
                // No interrupt tells of what has found no room.
                self.take(buffers);
                length
            });
            if length == 0 && !buffer.is_empty() { Poll::Pending } else { Poll::Ready(Some(length)) }
        })
        .await
    }

    async fn write(&self, characters: &[u8]) -> Option<usize> {
        poll_fn(|context| {
            self.writer.register(context.waker());
            let length = self.with(|buffers| {
                let room = buffers.outgoing.capacity() - buffers.outgoing.len();
                let piece = characters.get(..room).unwrap_or(characters);
                buffers.outgoing.extend(piece.iter().copied());
                self.send(buffers);
                piece.len()
            });
            if length == 0 && !characters.is_empty() { Poll::Pending } else { Poll::Ready(Some(length)) }
        })
        .await
    }
}
