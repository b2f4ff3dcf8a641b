//! Ethernet: the LAN9118, which keeps its frames in FIFOs of its own.

use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Context;

use embassy_net::driver::{Capabilities, Driver, HardwareAddress, LinkState, RxToken, TxToken};
use embassy_sync::waitqueue::AtomicWaker;
use static_cell::ConstStaticCell;

use super::interrupt::{Interrupt, enable};
use super::registers::ETHERNET;

const RX_DATA: usize = 0x00;
const TX_DATA: usize = 0x20;
const RX_STATUS: usize = 0x40;
const TX_STATUS: usize = 0x48;
const IRQ_CFG: usize = 0x54;
const INT_STS: usize = 0x58;
const INT_EN: usize = 0x5C;
const FIFO_INT: usize = 0x68;
const TX_CFG: usize = 0x70;
const RX_FIFO_INF: usize = 0x7C;
const TX_FIFO_INF: usize = 0x80;
const MAC_CSR_CMD: usize = 0xA4;
const MAC_CSR_DATA: usize = 0xA8;

/// IRQ_CFG: line on, active high, push-pull.
const IRQ_ON: u32 = 0x111;
/// INT_STS, INT_EN: a frame has come in.
const RSFL: u32 = 1 << 3;
/// INT_STS, INT_EN: the PHY has something to tell.
const PHY: u32 = 1 << 18;
/// FIFO_INT: never for data and sent frames, for received frames above 0.
const LEVELS: u32 = 0xFF00_0000;
/// TX_CFG: transmitter on.
const TX_ON: u32 = 1 << 1;
/// TX command A: the buffer is the whole frame.
const WHOLE: u32 = 1 << 13 | 1 << 12;
/// RX status: the frame has an error.
const RX_ERROR: u32 = 1 << 15;
/// Check sequence at the end of a received frame.
const FCS: usize = 4;

// Registers of the MAC, behind MAC_CSR_CMD.
const MAC_CR: u32 = 1;
const ADDRH: u32 = 2;
const ADDRL: u32 = 3;
const MII_ACC: u32 = 6;
const MII_DATA: u32 = 7;
/// MAC_CR: full duplex, frames to any group pass, transmitter and receiver on.
const MAC_ON: u32 = 1 << 20 | 1 << 19 | 1 << 3 | 1 << 2;
const CSR_BUSY: u32 = 1 << 31;
const CSR_READ: u32 = 1 << 30;

// Registers of the PHY, behind MII_ACC.
const PHY_STATUS: u32 = 1;
const PHY_SOURCE: u32 = 29;
const PHY_MASK: u32 = 30;
/// PHY_STATUS: the link is up.
const LINK_UP: u32 = 1 << 2;
/// PHY_MASK: negotiation complete, link down.
const LINK_CHANGES: u32 = 1 << 6 | 1 << 4;

/// Longest frame without its check sequence, in bytes and in words.
const LONGEST: usize = 1514;
const WORDS: usize = LONGEST.div_ceil(4);

static WAKER: AtomicWaker = AtomicWaker::new();
/// The PHY has something to tell.
static LINK: AtomicBool = AtomicBool::new(true);

/// The interrupt: somebody has to look, and lets the next one through.
pub(super) fn interrupted() {
    if ETHERNET.read(INT_STS) & PHY != 0 {
        LINK.store(true, Ordering::Relaxed);
    }
    ETHERNET.write(INT_EN, 0);
    WAKER.wake();
}

fn mac_read(register: u32) -> u32 {
    ETHERNET.write(MAC_CSR_CMD, CSR_BUSY | CSR_READ | register);
    ETHERNET.read(MAC_CSR_DATA)
}

fn mac_write(register: u32, value: u32) {
    ETHERNET.write(MAC_CSR_DATA, value);
    ETHERNET.write(MAC_CSR_CMD, CSR_BUSY | register);
}

/// MII_ACC for a register of the PHY, whose address is 1.
fn mii(register: u32) -> u32 {
    1 << 11 | register << 6 | 1
}

fn phy_read(register: u32) -> u32 {
    mac_write(MII_ACC, mii(register));
    mac_read(MII_DATA)
}

fn phy_write(register: u32, value: u32) {
    mac_write(MII_DATA, value);
    mac_write(MII_ACC, mii(register) | 1 << 1);
}

/// Frames that have come in and are not fetched.
fn waiting() -> bool {
    ETHERNET.read(RX_FIFO_INF) >> 16 & 0xFF != 0
}

/// A frame, in words as the FIFOs have it.
struct Frame([u32; WORDS]);

impl Frame {
    fn bytes(&mut self) -> &mut [u8; WORDS * 4] {
        // SAFETY: the same memory, of a type that needs no alignment and has no invalid value. The FIFOs put the first
        // byte of a frame into the lowest of a word, which comes first in this memory.
        unsafe { &mut *(&raw mut self.0).cast() }
    }
}

/// The controller.
pub(super) struct Lan9118 {
    mac: [u8; 6],
    link: LinkState,
    received: &'static mut Frame,
    sent: &'static mut Frame,
}

impl Lan9118 {
    /// Starts it. Call it once.
    pub(super) fn start() -> Self {
        static RECEIVED: ConstStaticCell<Frame> = ConstStaticCell::new(Frame([0; WORDS]));
        static SENT: ConstStaticCell<Frame> = ConstStaticCell::new(Frame([0; WORDS]));
        let ([m0, m1, m2, m3], [m4, m5, ..]) = (mac_read(ADDRL).to_le_bytes(), mac_read(ADDRH).to_le_bytes());
        ETHERNET.write(FIFO_INT, LEVELS);
        ETHERNET.write(TX_CFG, TX_ON);
        mac_write(MAC_CR, MAC_ON);
        phy_write(PHY_MASK, LINK_CHANGES);
        ETHERNET.write(IRQ_CFG, IRQ_ON);
        enable(Interrupt::Ethernet);
        Self {
            mac: [m0, m1, m2, m3, m4, m5],
            link: LinkState::Down,
            received: RECEIVED.take(),
            sent: SENT.take(),
        }
    }

    /// QEMU's choice, or that of its option `mac`.
    pub(super) fn mac(&self) -> [u8; 6] {
        self.mac
    }

    /// Fetches the next good frame: its length.
    fn fetch(&mut self) -> Option<usize> {
        while waiting() {
            let status = ETHERNET.read(RX_STATUS);
            let length = (status >> 16 & 0x3FFF) as usize;
            let mut words = self.received.0.iter_mut();
            for _ in 0..length.div_ceil(4) {
                let word = ETHERNET.read(RX_DATA);
                if let Some(to) = words.next() {
                    *to = word;
                }
            }
            let length = length.saturating_sub(FCS);
            if status & RX_ERROR == 0 && length <= WORDS * 4 {
                return Some(length);
            }
        }
        None
    }
}

impl Driver for Lan9118 {
    type RxToken<'a> = Received<'a>;
    type TxToken<'a> = Sending<'a>;

    fn receive(&mut self, context: &mut Context<'_>) -> Option<(Received<'_>, Sending<'_>)> {
        WAKER.register(context.waker());
        if !waiting() {
            // Forgets frames that were fetched; one that comes after this is told.
            ETHERNET.write(INT_STS, RSFL);
            ETHERNET.write(INT_EN, RSFL | PHY);
        }
        let length = self.fetch()?;
        Some((Received(self.received.bytes().get_mut(..length)?), Sending(self.sent)))
    }

    /// QEMU hands a frame on as soon as it is whole: there is always room.
    fn transmit(&mut self, _: &mut Context<'_>) -> Option<Sending<'_>> {
        Some(Sending(self.sent))
    }

    fn link_state(&mut self, context: &mut Context<'_>) -> LinkState {
        WAKER.register(context.waker());
        if LINK.swap(false, Ordering::Relaxed) {
            phy_read(PHY_SOURCE);
            ETHERNET.write(INT_STS, PHY);
            let up = phy_read(PHY_STATUS) & LINK_UP != 0;
            self.link = if up { LinkState::Up } else { LinkState::Down };
        }
        self.link
    }

    fn capabilities(&self) -> Capabilities {
        let mut capabilities = Capabilities::default();
        capabilities.max_transmission_unit = LONGEST;
        capabilities.max_burst_size = Some(1);
        capabilities
    }

    fn hardware_address(&self) -> HardwareAddress {
        HardwareAddress::Ethernet(self.mac)
    }
}

/// A received frame.
pub(super) struct Received<'a>(&'a mut [u8]);

impl RxToken for Received<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, f: F) -> R {
        f(self.0)
    }
}

/// Room for a frame to send.
pub(super) struct Sending<'a>(&'a mut Frame);

impl TxToken for Sending<'_> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, f: F) -> R {
        let length = length.min(WORDS * 4);
        let result = f(&mut self.0.bytes()[..length]);
        ETHERNET.write(TX_DATA, WHOLE | length as u32);
        ETHERNET.write(TX_DATA, length as u32);
        for word in self.0.0.iter().take(length.div_ceil(4)) {
            ETHERNET.write(TX_DATA, *word);
        }
        // How it went interests nobody, but unread statuses stop the transmitter.
        while ETHERNET.read(TX_FIFO_INF) >> 16 & 0xFF != 0 {
            ETHERNET.read(TX_STATUS);
        }
        result
    }
}
