//! The CAN buses by their names. docs/boards.md has their pins.

use core::future::pending;

use embassy_stm32::Peri;
use embassy_stm32::can::{RxPin, TxPin};
use puente_canopen::Frame;

use super::board::{CAN1, CAN2};
use super::lines::BadPort;
use crate::port::{BIT_RATES, CanCounters, CanEvent, CanPort, CanReader, CanState, CanWriter, NotTaken};

/// The buses that are not open yet.
pub struct Cans {
    free: [bool; 2],
}

fn number(port: &str) -> Result<usize, BadPort> {
    match port {
        "can-1" => Ok(0),
        "can-2" => Ok(1),
        _ => Err(BadPort::Can),
    }
}

/// Whether a bus can have this `port` with this bit rate.
pub fn check_can(port: &str, bitrate: u32) -> Result<(), BadPort> {
    number(port)?;
    if BIT_RATES.contains(&bitrate) { Ok(()) } else { Err(BadPort::BitRate) }
}

impl Cans {
    /// All buses, by their pins: the compiler makes sure that they have these signals.
    pub(super) fn new(
        _rx1: Peri<'static, impl RxPin<CAN1>>,
        _tx1: Peri<'static, impl TxPin<CAN1>>,
        _rx2: Peri<'static, impl RxPin<CAN2>>,
        _tx2: Peri<'static, impl TxPin<CAN2>>,
    ) -> Self {
        Self { free: [true; 2] }
    }

    /// Opens `can-1` or `can-2`, each once.
    pub fn open(&mut self, port: &str, bitrate: u32) -> Result<Can, BadPort> {
        check_can(port, bitrate)?;
        let free = self.free.get_mut(number(port)?).ok_or(BadPort::Can)?;
        if core::mem::take(free) { Ok(Can(())) } else { Err(BadPort::Can) }
    }
}

/// An open bus.
pub struct Can(());

impl CanPort for Can {
    type Reader<'a> = Reader<'a>;
    type Writer<'a> = Writer<'a>;

    fn split(&mut self) -> (Reader<'_>, Writer<'_>) {
        (Reader(self), Writer(self))
    }
}

/// The receiving half.
pub struct Reader<'a>(#[expect(dead_code)] &'a Can);

impl CanReader for Reader<'_> {
    async fn read(&mut self) -> CanEvent {
        pending().await
    }

    fn counters(&self) -> CanCounters {
        CanCounters::default()
    }
}

/// The sending half.
pub struct Writer<'a>(#[expect(dead_code)] &'a Can);

impl CanWriter for Writer<'_> {
    async fn write(&mut self, _: &Frame) -> Result<(), NotTaken> {
        Err(NotTaken(CanState::Down))
    }

    fn discard(&mut self) {}
}
