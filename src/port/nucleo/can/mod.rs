//! The CAN buses by their names, and what both kinds of controller have in common. docs/boards.md has their pins.
//!
//! embassy's drivers set the controllers up. The frames pass by them: of a full buffer they drop frames without a word, FDCAN's
//! sends a remote frame with a length as data, and bxCAN's has its interrupts off until somebody reads.

#[cfg(feature = "nucleo-h753zi")]
#[path = "fdcan.rs"]
mod controller;
#[cfg(not(feature = "nucleo-h753zi"))]
#[path = "bxcan.rs"]
mod controller;
mod shared;

use core::future::{pending, poll_fn};

use embassy_futures::select::{Either, select};
use embassy_stm32::Peri;
use embassy_stm32::peripherals::{PB6, PB12, PD0, PD1};
use embassy_time::{Duration, Timer};
use puente_canopen::Frame;

use self::controller::{Controller, LIMITS, one, two};
use self::shared::Shared;
use super::board::{self, CAN1, CAN2};
use super::lines::BadPort;
use crate::port::can::timing::Timing;
use crate::port::{CanCounters, CanEvent, CanPort, CanReader, CanState, CanWriter, NotTaken};

/// How often the controller is looked at while all is not well: not every way back has an interrupt.
const LOOK: Duration = Duration::from_millis(10);

/// The buses that are not open yet.
pub struct Cans {
    one: Option<(Peri<'static, CAN1>, Peri<'static, PD0>, Peri<'static, PD1>)>,
    two: Option<(Peri<'static, CAN2>, Peri<'static, PB12>, Peri<'static, PB6>)>,
}

/// Whether a bus can have this `port` with this bit rate.
pub fn check_can(port: &str, bitrate: u32) -> Result<(), BadPort> {
    if !matches!(port, "can-1" | "can-2") {
        return Err(BadPort::Can);
    }
    timing(bitrate).map(|_| ())
}

fn timing(bitrate: u32) -> Result<Timing, BadPort> {
    Timing::new(board::CAN_CLOCK, bitrate, LIMITS).ok_or(BadPort::BitRate)
}

impl Cans {
    /// All buses.
    pub(super) fn new(
        one: (Peri<'static, CAN1>, Peri<'static, PD0>, Peri<'static, PD1>),
        two: (Peri<'static, CAN2>, Peri<'static, PB12>, Peri<'static, PB6>),
    ) -> Self {
        Self { one: Some(one), two: Some(two) }
    }

    /// Opens `can-1` or `can-2`, each once.
    pub fn open(&mut self, port: &str, bitrate: u32) -> Result<Can, BadPort> {
        let timing = timing(bitrate)?;
        match port {
            "can-1" => {
                let (can, rx, tx) = self.one.take().ok_or(BadPort::Can)?;
                one::open(can, rx, tx, timing).ok_or(BadPort::BitRate)
            }
            "can-2" => {
                let (can, rx, tx) = self.two.take().ok_or(BadPort::Can)?;
                two::open(can, rx, tx, timing).ok_or(BadPort::BitRate)
            }
            _ => Err(BadPort::Can),
        }
    }
}

/// An open bus.
pub struct Can {
    controller: Controller,
    shared: &'static Shared,
}

impl CanPort for Can {
    type Reader<'a> = Reader<'a>;
    type Writer<'a> = Writer<'a>;

    fn split(&mut self) -> (Reader<'_>, Writer<'_>) {
        (Reader(self), Writer(self))
    }
}

/// The receiving half.
pub struct Reader<'a>(&'a Can);

impl CanReader for Reader<'_> {
    async fn read(&mut self) -> CanEvent {
        let Can { controller, shared } = self.0;
        loop {
            let event = poll_fn(|context| shared.poll_event(context));
            let look = async {
                match shared.state() {
                    CanState::Active => pending().await,
                    _ => Timer::after(LOOK).await,
                }
            };
            match select(event, look).await {
                Either::First(event) => return event,
                Either::Second(()) => shared.look(*controller),
            }
        }
    }

    fn counters(&self) -> CanCounters {
        let (tx_errors, rx_errors) = self.0.controller.errors();
        CanCounters { tx_errors, rx_errors, ..self.0.shared.counters() }
    }
}

/// The sending half.
pub struct Writer<'a>(&'a Can);

impl CanWriter for Writer<'_> {
    async fn write(&mut self, frame: &Frame) -> Result<(), NotTaken> {
        let Can { controller, shared } = self.0;
        poll_fn(|context| shared.poll_send(context, *controller, frame)).await
    }

    /// What is on the bus already comes to its end.
    fn discard(&mut self) {
        self.0.controller.abort();
    }
}
