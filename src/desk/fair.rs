//! Whose request is next: stops first, then clients in turn.

use super::Class;

/// Who was served last.
#[derive(Clone, Copy)]
pub(super) struct Fair {
    seat: u8,
    /// It was a [`Class::Motion`].
    moved: bool,
}

/// The lowest is next.
pub(super) type Rank = (bool, bool, u8, u32);

impl Fair {
    pub(super) const fn new() -> Self {
        Self { seat: 0, moved: false }
    }

    /// The rank of a request that came as number `serial`.
    pub(super) fn rank(&self, class: Class, seat: u8, serial: u32) -> Rank {
        let moves = matches!(class, Class::Motion(_));
        // How many seats it comes after the one served last.
        let distance = seat.wrapping_sub(self.seat).wrapping_sub(1);
        (class != Class::Stop, moves == self.moved, distance, serial)
    }

    /// A request was served.
    pub(super) fn served(&mut self, class: Class, seat: u8) {
        if class != Class::Stop {
            *self = Self { seat, moved: matches!(class, Class::Motion(_)) };
        }
    }
}
