//! The data and status registers of a USART as F7 and H7 have them (RM0410, 34.8; RM0433, 48.7).

use embassy_stm32::pac::usart::Usart;

/// What the status register tells of the character that is about to be fetched.
pub(super) struct Arrival {
    pub received: bool,
    pub overrun: bool,
    pub framing: bool,
    pub parity: bool,
}

pub(super) fn arrival(usart: Usart) -> Arrival {
    let status = usart.isr().read();
    Arrival { received: status.rxne(), overrun: status.ore(), framing: status.fe(), parity: status.pe() }
}

/// Whether a character is arriving: from its start bit to its stop bit.
pub(super) fn is_receiving(usart: Usart) -> bool {
    usart.isr().read().busy()
}

/// Whether it takes a character to send.
pub(super) fn has_room(usart: Usart) -> bool {
    usart.isr().read().txe()
}

/// Gives it one; there must be room.
pub(super) fn put(usart: Usart, character: u8) {
    usart.tdr().write(|data| data.set_dr(character.into()));
}

/// Takes back what it has not begun to send. H7 has a FIFO, which can be emptied; F7 has one character, and keeps it.
pub(super) fn empty(usart: Usart) {
    #[cfg(any(feature = "nucleo-h753zi", feature = "nucleo-g474re"))]
    usart.rqr().write(|request| request.set_txfrq(true));
    #[cfg(not(any(feature = "nucleo-h753zi", feature = "nucleo-g474re")))]
    let _ = usart;
}
