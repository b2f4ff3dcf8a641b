//! The data and status registers of a USART as F4 has them (RM0090, 30.6).

use embassy_stm32::pac::usart::Usart;

/// What the status register tells of the character that is about to be fetched.
pub(super) struct Arrival {
    pub received: bool,
    pub overrun: bool,
    pub framing: bool,
    pub parity: bool,
}

pub(super) fn arrival(usart: Usart) -> Arrival {
    let status = usart.sr().read();
    Arrival { received: status.rxne(), overrun: status.ore(), framing: status.fe(), parity: status.pe() }
}

/// Whether a character is arriving: this USART does not tell.
pub(super) fn is_receiving(_: Usart) -> bool {
    false
}

/// Whether it takes a character to send.
pub(super) fn has_room(usart: Usart) -> bool {
    usart.sr().read().txe()
}

/// Gives it one; there must be room.
pub(super) fn put(usart: Usart, character: u8) {
    usart.dr().write(|data| data.set_dr(character.into()));
}

/// Takes back what it has not begun to send: this one keeps it.
pub(super) fn empty(_: Usart) {}
