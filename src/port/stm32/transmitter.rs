//! What goes out.

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::{Poll, Waker};

use embassy_stm32::pac::usart::Usart;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::AtomicWaker;
use heapless::Deque;

use super::registers;

/// Characters taken and not yet sent: a Modbus ASCII frame has 513.
const TRANSMIT: usize = 520;
/// So many are left when the writer is told that there is room.
const FEW: usize = TRANSMIT / 2;

/// What is to be sent. embassy's driver cannot be told to stop, so that a handler of our own gives the USART its
/// characters, after embassy's, which finds none and switches the interrupt for more of them off.
pub(super) struct Transmitter {
    outgoing: Mutex<CriticalSectionRawMutex, RefCell<Outgoing>>,
    /// The last character has been handed to the USART.
    ending: AtomicBool,
    writer: AtomicWaker,
}

struct Outgoing {
    characters: Deque<u8, TRANSMIT>,
    /// From the first of them until the end of the last.
    sending: bool,
}

impl Outgoing {
    /// Lets the next interrupt come: where the USART has room for a character, or at the end of the last one.
    fn go_on(&self, usart: Usart) {
        let more = !self.characters.is_empty();
        usart.cr1().modify(|control| {
            control.set_txeie(more);
            control.set_tcie(!more);
        });
    }
}

impl Transmitter {
    pub(super) const fn new() -> Self {
        let outgoing = Outgoing { characters: Deque::new(), sending: false };
        Self {
            outgoing: Mutex::new(RefCell::new(outgoing)),
            ending: AtomicBool::new(false),
            writer: AtomicWaker::new(),
        }
    }

    fn with<R>(&self, f: impl FnOnce(&mut Outgoing) -> R) -> R {
        self.outgoing.lock(|outgoing| f(&mut outgoing.borrow_mut()))
    }

    /// Before embassy's handler of the interrupt.
    pub(super) fn interrupting(&self, usart: Usart) {
        self.ending.store(usart.cr1().read().tcie(), Ordering::Relaxed);
    }

    /// After it: gives the USART the next character, where there is room. True where the handler has seen the end of the
    /// last one and none follows, so that the line is free.
    pub(super) fn interrupted(&self, usart: Usart) -> bool {
        let ended = self.ending.load(Ordering::Relaxed) && !usart.cr1().read().tcie();
        self.with(|outgoing| {
            if !outgoing.sending {
                return false;
            }
            if ended && outgoing.characters.is_empty() {
                outgoing.sending = false;
                self.writer.wake();
                return true;
            }
            if registers::has_room(usart)
                && let Some(character) = outgoing.characters.pop_front()
            {
                registers::put(usart, character);
                if outgoing.characters.len() == FEW {
                    self.writer.wake();
                }
            }
            outgoing.go_on(usart);
            false
        })
    }

    /// Whether something is on its way out.
    pub(super) fn is_sending(&self) -> bool {
        self.with(|outgoing| outgoing.sending)
    }

    /// Whether nothing is any more, the last stop bit included.
    pub(super) fn ended(&self, writer: &Waker) -> Poll<()> {
        self.writer.register(writer);
        if self.is_sending() { Poll::Pending } else { Poll::Ready(()) }
    }

    /// Takes what there is room for, once there is much of it. None where the line is free, which must be `raised` first.
    pub(super) fn take(
        &self,
        usart: Usart,
        writer: &Waker,
        characters: &[u8],
        raised: bool,
    ) -> Poll<Option<usize>> {
        self.writer.register(writer);
        self.with(|outgoing| {
            if !outgoing.sending && !raised {
                return Poll::Ready(None);
            }
            if outgoing.characters.len() > FEW {
                return Poll::Pending;
            }
            let room = TRANSMIT - outgoing.characters.len();
            let piece = characters.get(..room).unwrap_or(characters);
            outgoing.characters.extend(piece.iter().copied());
            outgoing.sending = true;
            outgoing.go_on(usart);
            Poll::Ready(Some(piece.len()))
        })
    }

    /// Sends no more than what the USART does not give back: the character under way, and on F4 and F7 the next one.
    pub(super) fn discard(&self, usart: Usart) {
        self.with(|outgoing| {
            outgoing.characters.clear();
            if outgoing.sending {
                registers::empty(usart);
                outgoing.go_on(usart);
            }
        });
    }
}
