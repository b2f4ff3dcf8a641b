//! What a module tells unasked: DAT of one byte, 0 for enabled, otherwise the cause of a fault as in a
//! [report](crate::report).

use puente_drives::pid::Event;
use puente_framed::section;

use crate::report::{cause_code, cause_of};

/// Bytes of an event's one section.
pub const BODY: usize = section::OVERHEAD + 1;

/// Reads DAT; `None` unless it is an event.
pub fn parse(data: &[u8]) -> Option<Event> {
    match data {
        [0] => Some(Event::Enabled),
        [code] => cause_of(*code).map(Event::Fault),
        _ => None,
    }
}

/// Writes DAT.
pub fn emit(event: Event) -> [u8; 1] {
    [match event {
        Event::Enabled => 0,
        Event::Fault(cause) => cause_code(cause),
    }]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_is_one_event_or_none() {
        let events = (0..=255).filter_map(|byte| parse(&[byte]).map(|event| (byte, event)));
        let count = events.inspect(|(byte, event)| assert_eq!(emit(*event), [*byte])).count();
        assert_eq!(count, 1 + 3 + 6);
        assert_eq!((parse(&[]), parse(&[0, 0])), (None, None));
    }
}
