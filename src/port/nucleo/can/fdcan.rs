//! FDCAN (RM0433, chapter 56) with classical frames.

use embassy_stm32::can::config::{FdCanConfig, NominalBitTiming};
use embassy_stm32::pac;
use embassy_stm32::pac::can::Fdcan;
use puente_canopen::{Frame, Id};

use crate::port::CanState;
use crate::port::can::timing::{FDCAN, Limits, Timing};

pub(super) const LIMITS: Limits = FDCAN;

/// Words of an element of the message RAM, as embassy lays it out: two of a header, and room for 64 bytes of data.
const ELEMENT: usize = 18;

// The first word of an element.
const EXTENDED: u32 = 1 << 30;
const REMOTE: u32 = 1 << 29;
/// A base identifier stands in the upper bits of an extended one.
const BASE_SHIFT: u32 = 18;
/// The second word: the data length code.
const LENGTH_SHIFT: u32 = 16;

/// The registers of a controller.
#[derive(Clone, Copy)]
pub(super) struct Controller(Fdcan);

impl Controller {
    /// The next frame received; all are in the first queue.
    pub(super) fn receive(self) -> Option<Frame> {
        let status = self.0.rxfs(0).read();
        if status.ffl() == 0 {
            return None;
        }
        let element = self.0.rxfc(0).read().fsa() as usize + usize::from(status.fgi()) * ELEMENT;
        let word = |at| pac::FDCANRAM.ram(element + at).read();
        let (first, second) = (word(0), word(1));
        let id =
            if first & EXTENDED != 0 { Id::extended(first) } else { Id::base((first >> BASE_SHIFT) as u16) };
        // A length code of 9 and more is one of 8 (ISO 11898-1).
        let length = (second >> LENGTH_SHIFT & 0xF).min(8) as u8;
        let [a, b, c, d] = word(2).to_le_bytes();
        let [e, f, g, h] = word(3).to_le_bytes();
        let data = [a, b, c, d, e, f, g, h];
        self.0.rxfa(0).write(|done| done.set_fai(status.fgi()));
        if first & REMOTE != 0 {
            Some(Frame::remote(id, length))
        } else {
            Frame::new(id, data.get(..length.into()).unwrap_or(&data))
        }
    }

    /// Whether a frame found no room since the last call.
    pub(super) fn take_overrun(self) -> bool {
        let flags = self.0.ir().read();
        // What is written as 1 is cleared. embassy's handler clears the flags of what it knows.
        self.0.ir().write(|clear| {
            clear.set_rfl(0, flags.rfl(0));
            clear.set_ew(flags.ew());
            clear.set_ep(flags.ep());
        });
        flags.rfl(0)
    }

    pub(super) fn state(self) -> CanState {
        let status = self.0.psr().read();
        CanState::flagged(status.bo(), status.ep(), status.ew())
    }

    /// The transmit and the receive error counter.
    pub(super) fn errors(self) -> (u8, u8) {
        let counters = self.0.ecr().read();
        (counters.tec(), counters.rec())
    }

    pub(super) fn is_pending(self, mailbox: usize) -> bool {
        self.0.txbrp().read().trp(mailbox)
    }

    /// Sends a frame from a free mailbox.
    pub(super) fn send(self, mailbox: usize, frame: &Frame) {
        let element = self.0.txbc().read().tbsa() as usize + mailbox * ELEMENT;
        let word = |at, value| pac::FDCANRAM.ram(element + at).write_value(value);
        let id = match frame.id() {
            Id::Base(id) => u32::from(id) << BASE_SHIFT,
            Id::Extended(id) => id | EXTENDED,
        };
        word(0, if frame.is_remote() { id | REMOTE } else { id });
        word(1, u32::from(frame.length()) << LENGTH_SHIFT);
        let mut bytes = frame.data().iter().copied();
        for at in [2, 3] {
            word(at, u32::from_le_bytes(core::array::from_fn(|_| bytes.next().unwrap_or(0))));
        }
        self.0.txbar().write(|add| add.set_ar(mailbox, true));
    }

    /// Takes the frames back that are not on the bus.
    pub(super) fn abort(self) {
        self.0.txbcr().write(|cancel| (0..3).for_each(|mailbox| cancel.set_cr(mailbox, true)));
    }

    /// The interrupts that embassy does not ask for: what was lost, and what fault confinement says.
    fn listen(self) {
        self.0.ie().modify(|enable| {
            enable.set_rfle(0, true);
            enable.set_ewe(true);
            enable.set_epe(true);
            // A frame that is taken back makes room as well.
            enable.set_tcfe(true);
        });
        self.0.txbcie().write(|enable| (0..3).for_each(|mailbox| enable.set_cf(mailbox, true)));
    }
}

/// Retransmission, recovery from bus-off, all frames into the first queue: these are embassy's defaults. What waits to be
/// sent goes by its identifier.
fn config(timing: Timing) -> Option<FdCanConfig> {
    Some(FdCanConfig::default().set_nominal_bit_timing(NominalBitTiming {
        prescaler: timing.prescaler.try_into().ok()?,
        seg1: timing.before.try_into().ok()?,
        seg2: timing.after.try_into().ok()?,
        sync_jump_width: timing.jump.try_into().ok()?,
    }))
}

macro_rules! fdcan {
    ($module:ident, $can:ident, rx $rx:ident, tx $tx:ident, $it0:ident, $it1:ident) => {
        pub(super) mod $module {
            use embassy_stm32::can::{CanConfigurator, IT0InterruptHandler, IT1InterruptHandler};
            use embassy_stm32::interrupt::typelevel::{self, Handler};
            use embassy_stm32::interrupt::{InterruptExt, Priority};
            use embassy_stm32::peripherals::{$can, $rx, $tx};
            use embassy_stm32::{Peri, bind_interrupts, interrupt, pac, rcc};

            use super::super::{Can, Shared, board};
            use super::{Controller, Timing, config};

            static SHARED: Shared = Shared::new();
            const CONTROLLER: Controller = Controller(pac::$can);

            /// Runs after embassy's handler, which clears the flags and ends bus-off.
            struct After;

            impl Handler<typelevel::$it0> for After {
                unsafe fn on_interrupt() {
                    pac::$can.ir().write(|clear| clear.set_tcf(true));
                    SHARED.look(CONTROLLER);
                }
            }

            bind_interrupts!(struct Interrupts {
                $it0 => IT0InterruptHandler<$can>, After;
                $it1 => IT1InterruptHandler<$can>;
            });

            /// Opens the bus, once; `None` where the controller's clock is not the one that the timing is for.
            pub(in super::super) fn open(
                can: Peri<'static, $can>,
                rx: Peri<'static, $rx>,
                tx: Peri<'static, $tx>,
                timing: Timing,
            ) -> Option<Can> {
                if rcc::frequency::<$can>().0 != board::CAN_CLOCK {
                    return None;
                }
                let config = config(timing)?;
                // Below the USARTs: the controller keeps three frames, they keep one character.
                interrupt::$it0.set_priority(Priority::P1);
                let mut driver = CanConfigurator::new(can, rx, tx, Interrupts);
                driver.set_config(config);
                // It stays for ever.
                core::mem::forget(driver.into_normal_mode());
                CONTROLLER.listen();
                SHARED.look(CONTROLLER);
                Some(Can { controller: CONTROLLER, shared: &SHARED })
            }
        }
    };
}

fdcan!(one, FDCAN1, rx PD0, tx PD1, FDCAN1_IT0, FDCAN1_IT1);
fdcan!(two, FDCAN2, rx PB12, tx PB6, FDCAN2_IT0, FDCAN2_IT1);
