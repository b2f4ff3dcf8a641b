//! Interrupts: their numbers, their priorities, and who handles them.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;

use super::{clock, executor, lan9118, line, uart};

/// The interrupts in use.
#[derive(Clone, Copy)]
#[repr(u16)]
pub(super) enum Interrupt {
    Uart1Receive = 2,
    Uart2Receive = 4,
    Timer0 = 8,
    Timer1 = 9,
    DualTimer = 10,
    Ethernet = 13,
    Uart3Receive = 18,
    Uart3Transmit = 19,
    Uart4Receive = 20,
    Uart4Transmit = 21,
    /// Spare ones, for the executors: pins of GPIO ports that nothing drives.
    Clients = 30,
    Buses = 31,
}

// SAFETY: the numbers differ, and all are below the 32 of this board.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

impl Interrupt {
    const ALL: [Self; 12] = [
        Self::Uart1Receive,
        Self::Uart2Receive,
        Self::Timer0,
        Self::Timer1,
        Self::DualTimer,
        Self::Ethernet,
        Self::Uart3Receive,
        Self::Uart3Transmit,
        Self::Uart4Receive,
        Self::Uart4Transmit,
        Self::Clients,
        Self::Buses,
    ];

    /// The lower, the more urgent; the same order as on the Nucleo boards.
    const fn priority(self) -> u8 {
        match self {
            // Above them is the loop of a PID interface module, see tick.rs.
            Self::Uart1Receive | Self::Uart2Receive | Self::Timer1 | Self::DualTimer => 0x20,
            Self::Uart3Receive | Self::Uart3Transmit | Self::Uart4Receive | Self::Uart4Transmit => 0x20,
            Self::Timer0 => 0x20,
            Self::Buses => 0x60,
            Self::Ethernet => 0x80,
            Self::Clients => 0xF0,
        }
    }
}

/// Sets the priorities; to be called before anything enables an interrupt.
pub(super) fn start(nvic: &mut NVIC) {
    for interrupt in Interrupt::ALL {
        // SAFETY: no code relies on priorities for exclusion; critical sections mask all interrupts.
        unsafe { nvic.set_priority(interrupt, interrupt.priority()) }
    }
}

/// Lets an interrupt through.
pub(super) fn enable(interrupt: Interrupt) {
    // SAFETY: critical sections mask all interrupts, so that this lets none into one.
    unsafe { NVIC::unmask(interrupt) }
}

/// Every interrupt comes here: the table of vectors is the runtime's default one.
#[exception]
unsafe fn DefaultHandler(number: i16) {
    match number {
        2 => line::UART1.received(),
        4 => line::UART2.received(),
        8 => clock::interrupted(),
        9 => line::UART1.ticked(),
        10 => line::UART2.ticked(),
        13 => lan9118::interrupted(),
        18 | 19 => uart::UART3.interrupted(),
        20 | 21 => uart::UART4.interrupted(),
        30 => executor::clients(),
        31 => executor::buses(),
        _ => panic!("interrupt {number}, which nobody enabled"),
    }
}
