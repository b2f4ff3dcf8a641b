//! What the wishes mean to CiA 402 drives.

use puente_drives::cia402::Mode;
use puente_servos::{Motion as Moves, Order, Progress, Report, Why};

use super::{Feedback, Kind, Motion, View, Wish};
use crate::desk::Cause;

/// CiA 402 drives on a CANopen bus.
pub struct Servos;

impl Kind for Servos {
    type Output = Order;
    type Report = Report;
    type Fall = Why;

    fn output(view: &View) -> Order {
        match view.wish {
            Wish::Observe => Order::Observe,
            Wish::Off => Order::Off,
            Wish::Stop => Order::Stop,
            Wish::Clear(serial) => Order::Reset { serial },
            Wish::Hold => Order::Hold,
            Wish::Move(Motion::Servo(motion), _) => Order::Move(motion),
            // That is none of a servo's.
            Wish::Move(Motion::Follow(_), _) => Order::Stop,
        }
    }

    fn feedback(report: Report) -> Feedback {
        Feedback::Servo(report)
    }

    fn fallen(wish: Wish, _: Why) -> Option<Wish> {
        matches!(wish, Wish::Hold | Wish::Move(..)).then_some(Wish::Observe)
    }

    fn cause(_: &View, why: Why) -> Cause {
        match why {
            Why::Fault(_) => Cause::DriveFault,
            Why::Left(_) => Cause::Stopped,
            Why::NotPresent | Why::Lost | Why::Rebooted | Why::NotOperational(_) | Why::Bus => {
                Cause::DriveLost
            }
        }
    }
}

/// What is wanted of a drive after a `wish` which this report answers. What has arrived is held where it is, and nobody
/// needs to show life for it.
pub(super) fn ends(report: &Report, wish: Wish) -> Option<Wish> {
    match (wish, report.progress) {
        (Wish::Off | Wish::Stop | Wish::Clear(_), Progress::Reached) => Some(Wish::Observe),
        (Wish::Clear(_), Progress::Failed(_)) => Some(Wish::Observe),
        (Wish::Move(Motion::Servo(motion), _), Progress::Reached) => arrives(motion).then_some(Wish::Hold),
        _ => None,
    }
}

/// Whether a motion has an end of its own, after which the drive stands in the same mode.
const fn arrives(motion: Moves) -> bool {
    match motion {
        Moves::Position { .. } | Moves::Home { .. } => true,
        Moves::Mode(mode) => matches!(mode, Mode::ProfilePosition | Mode::ProfileVelocity | Mode::Homing),
        Moves::Velocity(_) | Moves::Torque(_) | Moves::Interpolate(_) => false,
    }
}

#[cfg(test)]
mod tests;
