//! bxCAN (RM0090, chapter 32; RM0410, chapter 40).

use embassy_stm32::can::util::NominalBitTiming;
use embassy_stm32::pac;
use embassy_stm32::pac::can::Can as Registers;
use embassy_stm32::pac::can::vals::{Ide, Rtr};
use puente_canopen::{Frame, Id};

use crate::port::CanState;
use crate::port::can::mailboxes::MAILBOXES;
use crate::port::can::timing::{BXCAN, Limits, Timing};

pub(super) const LIMITS: Limits = BXCAN;

/// The first filter of CAN 2: both share those of CAN 1.
const SECOND: usize = 14;

/// The registers of a controller.
#[derive(Clone, Copy)]
pub(super) struct Controller(Registers);

impl Controller {
    /// The next frame received; all are in the first queue.
    pub(super) fn receive(self) -> Option<Frame> {
        let status = self.0.rfr(0);
        if status.read().fmp() == 0 {
            return None;
        }
        let place = self.0.rx(0);
        let head = place.rir().read();
        let id = match head.ide() {
            Ide::STANDARD => Id::base(head.stid()),
            Ide::EXTENDED => Id::extended(u32::from(head.stid()) << 18 | head.exid()),
        };
        // A length code of 9 and more is one of 8 (ISO 11898-1).
        let length = place.rdtr().read().dlc().min(8);
        let [a, b, c, d] = place.rdlr().read().0.to_le_bytes();
        let [e, f, g, h] = place.rdhr().read().0.to_le_bytes();
        let data = [a, b, c, d, e, f, g, h];
        status.write(|done| done.set_rfom(true));
        // The next one is there after some cycles.
        while status.read().rfom() {}
        match head.rtr() {
            Rtr::REMOTE => Some(Frame::remote(id, length)),
            Rtr::DATA => Frame::new(id, data.get(..length.into()).unwrap_or(&data)),
        }
    }

    /// Whether a frame found no room since the last call.
    pub(super) fn take_overrun(self) -> bool {
        let overrun = self.0.rfr(0).read().fovr();
        if overrun {
            // What is written as 1 is cleared.
            self.0.rfr(0).write(|clear| clear.set_fovr(true));
        }
        overrun
    }

    pub(super) fn state(self) -> CanState {
        let status = self.0.esr().read();
        CanState::flagged(status.boff(), status.epvf(), status.ewgf())
    }

    /// The transmit and the receive error counter.
    pub(super) fn errors(self) -> (u8, u8) {
        let status = self.0.esr().read();
        (status.tec(), status.rec())
    }

    pub(super) fn is_pending(self, mailbox: usize) -> bool {
        !self.0.tsr().read().tme(mailbox)
    }

    /// Sends a frame from a free mailbox.
    pub(super) fn send(self, mailbox: usize, frame: &Frame) {
        let place = self.0.tx(mailbox);
        place.tdtr().write(|length| length.set_dlc(frame.length()));
        let mut bytes = frame.data().iter().copied();
        let mut word = || u32::from_le_bytes(core::array::from_fn(|_| bytes.next().unwrap_or(0)));
        place.tdlr().write(|low| low.0 = word());
        place.tdhr().write(|high| high.0 = word());
        place.tir().write(|head| {
            match frame.id() {
                Id::Base(id) => head.set_stid(id),
                Id::Extended(id) => {
                    head.set_ide(Ide::EXTENDED);
                    head.set_stid((id >> 18) as u16);
                    head.set_exid(id & 0x3_FFFF);
                }
            }
            head.set_rtr(if frame.is_remote() { Rtr::REMOTE } else { Rtr::DATA });
            head.set_txrq(true);
        });
    }

    /// Takes the frames back that are not on the bus.
    pub(super) fn abort(self) {
        self.0.tsr().write(|abort| (0..MAILBOXES).for_each(|mailbox| abort.set_abrq(mailbox, true)));
    }

    /// An interrupt is over: embassy's handlers have switched some of its causes off.
    fn listen(self) {
        // What is written as 1 is cleared.
        self.0.msr().write(|clear| clear.set_erri(true));
        self.0.ier().write(|enable| {
            enable.set_tmeie(true);
            enable.set_fmpie(0, true);
            enable.set_fovie(0, true);
            // Fault confinement, but not each single error: there may be one every few bits.
            enable.set_ewgie(true);
            enable.set_epvie(true);
            enable.set_bofie(true);
            enable.set_errie(true);
        });
    }

    /// Takes part in the traffic after 11 recessive bits, for which nobody waits: retransmits, comes back from bus-off by
    /// itself, and sends what waits by its identifier.
    fn start(self) {
        self.0.mcr().write(|control| control.set_abom(true));
    }
}

/// All frames of both controllers go into their first queues. The filters are those of CAN 1.
fn accept_all() {
    pac::RCC.apb1enr().modify(|enable| enable.set_can1en(true));
    // The bus needs two of its clocks before the first access; a read back waits for them.
    pac::RCC.apb1enr().read();
    let filters = pac::CAN1;
    filters.fmr().write(|init| {
        init.set_finit(true);
        init.set_can2sb(SECOND as u8);
    });
    filters.fa1r().write(|active| active.0 = 0);
    for filter in [0, SECOND] {
        // One filter of 32 bits, whose mask looks at none of them.
        filters.fs1r().modify(|scale| scale.set_fsc(filter, true));
        filters.fm1r().modify(|mode| mode.set_fbm(filter, false));
        filters.ffa1r().modify(|queue| queue.set_ffa(filter, false));
        filters.fb(filter).fr1().write(|id| id.0 = 0);
        filters.fb(filter).fr2().write(|mask| mask.0 = 0);
    }
    filters.fa1r().write(|active| [0, SECOND].into_iter().for_each(|filter| active.set_fact(filter, true)));
    filters.fmr().modify(|init| init.set_finit(false));
}

fn bits(timing: Timing) -> Option<NominalBitTiming> {
    Some(NominalBitTiming {
        prescaler: timing.prescaler.try_into().ok()?,
        seg1: timing.before.try_into().ok()?,
        seg2: timing.after.try_into().ok()?,
        sync_jump_width: timing.jump.try_into().ok()?,
    })
}

macro_rules! bxcan {
    ($module:ident, $can:ident, rx $rx:ident, tx $tx:ident, $it_tx:ident, $it_rx0:ident, $it_rx1:ident, $it_sce:ident) => {
        pub(super) mod $module {
            use embassy_stm32::can::{
                Can as Driver, Rx0InterruptHandler, Rx1InterruptHandler, SceInterruptHandler, TxInterruptHandler,
            };
            use embassy_stm32::interrupt::typelevel::{self, Handler};
            use embassy_stm32::interrupt::{InterruptExt, Priority};
            use embassy_stm32::peripherals::{$can, $rx, $tx};
            use embassy_stm32::{Peri, bind_interrupts, interrupt, pac, rcc};

            use super::super::{Can, Shared, board};
            use super::{Controller, Timing, accept_all, bits};

            static SHARED: Shared = Shared::new();
            const CONTROLLER: Controller = Controller(pac::$can);

            /// Runs after embassy's handlers.
            struct After;

            impl After {
                fn look() {
                    SHARED.look(CONTROLLER);
                    CONTROLLER.listen();
                }
            }

            impl Handler<typelevel::$it_tx> for After {
                unsafe fn on_interrupt() {
                    Self::look();
                }
            }

            impl Handler<typelevel::$it_rx0> for After {
                unsafe fn on_interrupt() {
                    Self::look();
                }
            }

            impl Handler<typelevel::$it_sce> for After {
                unsafe fn on_interrupt() {
                    Self::look();
                }
            }

            bind_interrupts!(struct Interrupts {
                $it_tx => TxInterruptHandler<$can>, After;
                $it_rx0 => Rx0InterruptHandler<$can>, After;
                $it_rx1 => Rx1InterruptHandler<$can>;
                $it_sce => SceInterruptHandler<$can>, After;
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
                let bits = bits(timing)?;
                // Below the USARTs: the controller keeps three frames, they keep one character.
                interrupt::$it_tx.set_priority(Priority::P1);
                interrupt::$it_rx0.set_priority(Priority::P1);
                interrupt::$it_sce.set_priority(Priority::P1);
                let mut driver = Driver::new(can, rx, tx, Interrupts);
                drop(driver.modify_config().set_bit_timing(bits));
                // It stays for ever.
                core::mem::forget(driver);
                accept_all();
                CONTROLLER.start();
                CONTROLLER.listen();
                SHARED.look(CONTROLLER);
                Some(Can { controller: CONTROLLER, shared: &SHARED })
            }
        }
    };
}

bxcan!(one, CAN1, rx PD0, tx PD1, CAN1_TX, CAN1_RX0, CAN1_RX1, CAN1_SCE);
bxcan!(two, CAN2, rx PB12, tx PB6, CAN2_TX, CAN2_RX0, CAN2_RX1, CAN2_SCE);
