//! The registers of the board's peripherals (Arm CMSDK, DDI 0479; SMSC LAN9118 data sheet).

/// One peripheral's registers.
#[derive(Clone, Copy)]
pub(super) struct Registers(usize);

pub(super) const TIMER0: Registers = Registers(0x4000_0000);
pub(super) const TIMER1: Registers = Registers(0x4000_1000);
pub(super) const DUALTIMER: Registers = Registers(0x4000_2000);
pub(super) const UART1: Registers = Registers(0x4000_5000);
pub(super) const UART2: Registers = Registers(0x4000_6000);
pub(super) const UART3: Registers = Registers(0x4000_7000);
pub(super) const UART4: Registers = Registers(0x4000_9000);
pub(super) const WATCHDOG: Registers = Registers(0x4000_8000);
pub(super) const SCC: Registers = Registers(0x4002_F000);
pub(super) const ETHERNET: Registers = Registers(0xA000_0000);

/// The emulator's own page of memory, whose words say what else there is on the board.
pub(super) const EMULATOR: Registers = Registers(0x203F_F000);
/// Whether the user button is held, 1 where it is.
pub(super) const BUTTON: usize = 0x00;

/// Registers of a UART, and their bits.
pub(super) mod uart {
    pub const DATA: usize = 0x00;
    pub const STATE: usize = 0x04;
    pub const CONTROL: usize = 0x08;
    pub const INTERRUPT_CLEAR: usize = 0x0C;
    pub const BAUD_DIVIDER: usize = 0x10;

    /// State: the one character that there is room for has not gone out yet.
    pub const TRANSMIT_FULL: u32 = 0b01;
    /// State: a character has come in.
    pub const RECEIVE_FULL: u32 = 0b10;
    /// The least that the transmitter works with.
    pub const LEAST_DIVIDER: u32 = 16;
}

impl Registers {
    /// A peripheral's size in the memory map.
    const SIZE: usize = 0x1000;

    fn at(self, offset: usize) -> *mut u32 {
        debug_assert!(offset < Self::SIZE && offset.is_multiple_of(4));
        (self.0 + offset % Self::SIZE) as *mut u32
    }

    /// Reads the register at `offset`.
    pub(super) fn read(self, offset: usize) -> u32 {
        // SAFETY: the constants above are the only values of this type, each a peripheral whose whole page answers,
        // and which does not access memory by itself, or memory that nothing else uses.
        unsafe { self.at(offset).read_volatile() }
    }

    /// Writes the register at `offset`.
    pub(super) fn write(self, offset: usize, value: u32) {
        // SAFETY: as for `read`.
        unsafe { self.at(offset).write_volatile(value) }
    }
}
