//! The pins of CAN 1 and 2, which nothing else may take. docs/boards.md promises them.

use embassy_stm32::Peri;
use embassy_stm32::can::{RxPin, TxPin};

use super::board::{CAN1, CAN2};

/// Takes them out of what is left for others. The compiler makes sure that they have these signals.
pub(super) fn reserve(
    _rx1: Peri<'static, impl RxPin<CAN1>>,
    _tx1: Peri<'static, impl TxPin<CAN1>>,
    _rx2: Peri<'static, impl RxPin<CAN2>>,
    _tx2: Peri<'static, impl TxPin<CAN2>>,
) {
}
