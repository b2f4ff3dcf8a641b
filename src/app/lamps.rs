//! The lamps of a board: link, bus activity, fault.

use embassy_time::Timer;

use crate::desk::{Cause, Traffic};
use crate::front::Gateway;
use crate::port::{Lamps, Lights, Link};

/// Between two looks: the length of a pulse, long enough to be seen.
const STEP: embassy_time::Duration = embassy_time::Duration::from_millis(50);
/// Steps that a blinking lamp is on, and as many that it is off: once a second,
const SLOW: u32 = 10;
/// and twice.
const FAST: u32 = 5;

/// Shows the state of the gateway, for ever. It is not `whole` where a part of it did not start, or where it has started
/// because it had failed.
pub async fn show(gateway: &Gateway, lamps: &mut impl Lamps, link: impl Fn() -> Link, whole: bool) -> ! {
    let mut panel = Panel::default();
    loop {
        let traffic = gateway.desk.traffic();
        let fault = if whole { fault(gateway, &traffic) } else { Fault::Lasting };
        lamps.show(panel.next(link(), traffic.transactions, fault));
        Timer::after(STEP).await;
    }
}

/// What the fault lamp tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    None,
    /// A slave is out of order, or the stop of an axis is not confirmed.
    Passing,
    /// The gateway is not whole.
    Lasting,
}

fn fault(gateway: &Gateway, traffic: &Traffic) -> Fault {
    let mut events = gateway.axes.iter().filter_map(|(axis, _)| gateway.desk.event(axis));
    let unconfirmed = events.any(|event| event.cause == Cause::StopUnconfirmed);
    if unconfirmed || traffic.resting { Fault::Passing } else { Fault::None }
}

/// What the lamps show, step by step.
#[derive(Default)]
struct Panel {
    step: u32,
    /// Transactions that the lamp has shown.
    shown: u32,
    pulse: bool,
}

impl Panel {
    fn next(&mut self, link: Link, transactions: u32, fault: Fault) -> Lights {
        let blink = |steps: u32| (self.step / steps).is_multiple_of(2);
        let link = match link {
            Link::Down => false,
            Link::NoAddress => blink(SLOW),
            Link::Up => true,
        };
        let fault = match fault {
            Fault::None => false,
            Fault::Passing => blink(FAST),
            Fault::Lasting => true,
        };
        // Dark after each pulse, so that a busy line flickers and its last transaction can be told from the one before.
        self.pulse = !self.pulse && self.shown != transactions;
        if self.pulse {
            self.shown = transactions;
        }
        self.step = self.step.wrapping_add(1);
        Lights { link, bus: self.pulse, fault }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What one lamp does in the next steps.
    fn steps(count: usize, mut lamp: impl FnMut() -> bool) -> String {
        (0..count).map(|_| if lamp() { '#' } else { '.' }).collect()
    }

    #[test]
    fn the_link_lamp_is_on_with_an_address_and_blinks_without() {
        for (link, expected) in [
            (Link::Down, "........................"),
            (Link::NoAddress, "##########..........####"),
            (Link::Up, "########################"),
        ] {
            let mut panel = Panel::default();
            assert_eq!(steps(24, || panel.next(link, 0, Fault::None).link), expected, "{link:?}");
        }
    }

    #[test]
    fn each_transaction_is_one_pulse_and_a_busy_line_flickers() {
        let mut panel = Panel::default();
        let mut counts = [0, 1, 1, 1, 2, 3, 3, 3, 3, 100, 200, 300, 400, 400].into_iter();
        let mut lamp = || panel.next(Link::Up, counts.next().expect("a count"), Fault::None).bus;
        assert_eq!(steps(14, &mut lamp), ".#..#.#..#.#.#");
    }

    #[test]
    fn the_count_of_transactions_may_wrap() {
        let mut panel = Panel::default();
        let mut counts = [u32::MAX, u32::MAX, 0, 0].into_iter();
        let mut lamp = || panel.next(Link::Up, counts.next().expect("a count"), Fault::None).bus;
        assert_eq!(steps(4, &mut lamp), "#.#.");
    }

    #[test]
    fn the_fault_lamp_blinks_for_what_may_pass_and_is_on_for_what_does_not() {
        for (fault, expected) in [
            (Fault::None, "............"),
            (Fault::Passing, "#####.....##"),
            (Fault::Lasting, "############"),
        ] {
            let mut panel = Panel::default();
            assert_eq!(steps(12, || panel.next(Link::Up, 0, fault).fault), expected, "{fault:?}");
        }
    }
}
