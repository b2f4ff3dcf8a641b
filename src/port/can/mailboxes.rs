//! Which of a controller's three mailboxes a frame goes to. The controller sends the one of the lowest identifier first, and of
//! two with the same identifier that of the lower mailbox: so no two of these may wait at once.

use puente_canopen::Id;

/// Mailboxes of a controller.
pub const MAILBOXES: usize = 3;

/// The mailbox for a frame; `None` where it has to wait.
///
/// The last one is for a frame that goes before those that wait already: so the most urgent one waits for no more than the
/// frame that is on the bus.
pub fn mailbox(waiting: &[Option<Id>; MAILBOXES], id: Id) -> Option<usize> {
    let mut free = (0..).zip(waiting).filter(|(_, waits)| waits.is_none());
    let first = free.next().map(|(mailbox, _)| mailbox)?;
    let last = free.next().is_none();
    let mut waiting = waiting.iter().flatten();
    let room = if last {
        waiting.all(|other| order(id) < order(*other))
    } else {
        waiting.all(|other| order(id) != order(*other))
    };
    room.then_some(first)
}

/// Which frame goes first: the one of the lower number.
fn order(id: Id) -> u32 {
    const EXTENDED: u32 = 1 << 18;
    match id {
        Id::Base(id) => u32::from(id) << 19,
        Id::Extended(id) => (id >> 18) << 19 | EXTENDED | id & (EXTENDED - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn some(id: u16) -> Option<Id> {
        Some(Id::base(id))
    }

    #[test]
    fn two_frames_may_wait() {
        assert_eq!(mailbox(&[None, None, None], Id::base(0x602)), Some(0));
        assert_eq!(mailbox(&[some(0x602), None, None], Id::base(0x603)), Some(1));
        assert_eq!(mailbox(&[None, some(0x602), None], Id::base(0x603)), Some(0));
    }

    #[test]
    fn frames_of_the_same_identifier_keep_their_order() {
        assert_eq!(mailbox(&[some(0x602), None, None], Id::base(0x602)), None);
    }

    #[test]
    fn the_last_mailbox_is_for_the_most_urgent_one() {
        let waiting = [some(0x602), None, some(0x200)];
        assert_eq!(mailbox(&waiting, Id::base(0x603)), None);
        assert_eq!(mailbox(&waiting, Id::base(0x200)), None);
        assert_eq!(mailbox(&waiting, Id::base(0x080)), Some(1));
        assert_eq!(mailbox(&[some(0x602), some(0x80), some(0x200)], Id::base(0)), None);
    }

    /// ISO 11898-1: base identifiers win over extended ones with the same first 11 bits.
    #[test]
    fn identifiers_are_in_the_order_of_arbitration() {
        let ids = [Id::base(0), Id::extended(0), Id::extended(1), Id::extended(1 << 18), Id::base(2)];
        assert!(ids.windows(2).all(|pair| order(pair[0]) < order(pair[1])));
    }
}
