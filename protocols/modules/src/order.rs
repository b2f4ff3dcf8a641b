//! What a module shall do.

/// What a module shall be at. Said again in every cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Control {
    /// No current; a fault is acknowledged.
    Off,
    /// Under current; stands where it is.
    Hold,
    /// Goes to the set-point.
    Follow,
    /// As it is: gains and set-point are not looked at.
    #[default]
    Observe,
}

impl Control {
    /// Whether this, after `before`, is a step towards standstill.
    pub(crate) const fn stops_after(self, before: Self) -> bool {
        matches!(
            (before, self),
            (Self::Follow, Self::Hold) | (Self::Follow | Self::Hold | Self::Observe, Self::Off)
        )
    }
}

/// The fifth value of a section.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Order {
    /// What the module shall be at.
    pub control: Control,
    /// Whether it shall report.
    pub ask: bool,
}

impl Order {
    /// As a digit: the control, 4 more if it asks.
    pub const fn digit(self) -> u8 {
        let control = match self.control {
            Control::Off => 0,
            Control::Hold => 1,
            Control::Follow => 2,
            Control::Observe => 3,
        };
        b'0' + control + if self.ask { 4 } else { 0 }
    }

    /// The order of a digit; `None` unless it is `0` to `7`.
    pub const fn from_digit(digit: u8) -> Option<Self> {
        let control = match digit {
            b'0' | b'4' => Control::Off,
            b'1' | b'5' => Control::Hold,
            b'2' | b'6' => Control::Follow,
            b'3' | b'7' => Control::Observe,
            _ => return None,
        };
        Some(Self { control, ask: digit >= b'4' })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_and_orders_are_the_same() {
        for byte in 0..=255 {
            match Order::from_digit(byte) {
                Some(order) => assert_eq!(order.digit(), byte),
                None => assert!(!(b'0'..=b'7').contains(&byte)),
            }
        }
        let order = Order { control: Control::Follow, ask: true };
        assert_eq!(order.digit(), b'6');
    }
}
