use proptest::prelude::*;

use super::*;

const EMPTY: Record = Record {
    head: Head { magic: 0, cause: 0, resets: 0, reason: 0, moving: 0, alive_ms: [0; 2], check: 0 },
    crash: Note::none(),
    watchdog: Note::none(),
};

/// What a board remembers that was switched on, and has then commanded the axes 0 and 5.
fn running() -> Record {
    let mut record = EMPTY.begin(None, "");
    record.head.change(|head| {
        head.may_move(0, true);
        head.may_move(3, true);
        head.may_move(5, true);
        head.may_move(3, false);
        head.alive(0x1_0000_0007);
    });
    record
}

#[test]
fn memory_without_a_record_is_a_power_on() {
    let record = EMPTY.begin(None, "");
    assert_eq!((record.head.started(), record.head.moving()), ((Reset::PowerOn, 0), 0));
    assert_eq!((record.crash.incident(), record.watchdog.incident()), (None, None));
}

#[test]
fn what_the_gateway_said_of_its_reset_is_the_cause() {
    for reason in [Reset::Software, Reset::Panic, Reset::Fault] {
        let mut record = running();
        record.head.change(|head| {
            head.reason(reason);
            // What comes while it fails is not why.
            head.reason(Reset::Watchdog);
        });
        for hardware in [None, Some(Reset::Software)] {
            let next = record.begin(hardware, "");
            assert_eq!((next.head.started(), next.head.moving()), ((reason, 1), 0b10_0001));
            // It counts once.
            let again = next.begin(hardware, "");
            assert_eq!(again.head.started(), (hardware.unwrap_or(Reset::Pin), 2));
        }
        assert_eq!(record.begin(Some(Reset::BrownOut), "").head.started(), (Reset::BrownOut, 1));
    }
}

#[test]
fn after_a_power_on_nothing_is_trusted() {
    let mut record = running();
    record.crash = Note::new(Reset::Panic, 5, format_args!("why"));
    record.head.change(|head| head.reason(Reset::Panic));
    let next = record.begin(Some(Reset::PowerOn), "");
    assert_eq!((next.head.started(), next.head.moving()), ((Reset::PowerOn, 0), 0));
    assert_eq!(next.crash.incident(), None);
}

#[test]
fn a_torn_record_moves_every_axis() {
    let mut record = running();
    record.head.moving = 0;
    let next = record.begin(Some(Reset::Watchdog), "");
    assert_eq!((next.head.started(), next.head.moving()), ((Reset::Watchdog, 1), u32::MAX));
}

#[test]
fn a_watchdog_that_nobody_foresaw_is_an_incident_too() {
    let record = running().begin(Some(Reset::Watchdog), "starved");
    let incident = record.watchdog.incident().expect("an incident");
    assert_eq!((incident.text.as_str(), incident.uptime_ms), ("starved", 0x1_0000_0007));
    let mut told = running();
    told.watchdog = Note::new(Reset::Watchdog, 9, format_args!("bus a"));
    told.head.change(|head| head.reason(Reset::Watchdog));
    for hardware in [None, Some(Reset::Watchdog)] {
        let record = told.begin(hardware, "starved");
        assert_eq!(record.head.started().0, Reset::Watchdog);
        assert_eq!(record.watchdog.incident().expect("an incident").text, "bus a");
    }
}

#[test]
fn a_note_is_one_line_cut_to_its_room() {
    let note = Note::new(Reset::Fault, 7, format_args!("a \"b\"\nc"));
    let incident = note.incident().expect("an incident");
    assert_eq!((incident.cause, incident.text.as_str()), (Reset::Fault, "a 'b' c"));
    let long = Note::new(Reset::Panic, 7, format_args!("{}", "ä".repeat(100)));
    assert_eq!(long.incident().expect("an incident").text.as_str(), "ä".repeat(TEXT / 2));
}

proptest! {
    #[test]
    fn one_wrong_bit_is_found(word in 0..8_usize, bit in 0..32_u32) {
        let mut record = running();
        let head = &mut record.head;
        let words = [
            &mut head.magic, &mut head.cause, &mut head.resets, &mut head.reason, &mut head.moving,
            &mut head.check,
        ];
        let [low, high] = &mut head.alive_ms;
        let flipped = words.into_iter().chain([low, high]).nth(word).expect("a word");
        *flipped ^= 1 << bit;
        prop_assert_eq!(record.begin(None, "").head.started(), (Reset::PowerOn, 0));
    }

    #[test]
    fn a_spoilt_note_is_none(at in 0..TEXT, bit in 0..8_u8, length in 0..=200_u32) {
        let mut note = Note::new(Reset::Panic, 1, format_args!("src/app/mod.rs:7: why"));
        note.text[at] ^= 1 << bit;
        prop_assert_eq!(note.incident(), None);
        note.text[at] ^= 1 << bit;
        note.length = length;
        prop_assert_eq!(note.incident().is_some(), length == 21);
    }

    #[test]
    fn any_memory_can_be_begun_with(
        words in proptest::array::uniform7(any::<u32>()), text in any::<[u8; 32]>(), length in any::<u32>()
    ) {
        let [magic, cause, resets, reason, moving, check, more] = words;
        let head = Head { magic, cause, resets, reason, moving, alive_ms: [more, check], check };
        let mut note = Note { cause, uptime_ms: [more, check], length, text: [0; TEXT], check };
        note.text[..32].copy_from_slice(&text);
        let record = Record { head, crash: note, watchdog: note };
        for hardware in [None, Some(Reset::Pin), Some(Reset::Watchdog)] {
            let mut begun = record.begin(hardware, "starved");
            let _ = (begun.crash.incident(), begun.watchdog.incident());
            begun.head.change(|head| head.alive(u64::MAX));
            prop_assert!(begun.head.sound());
        }
        // A note whose check is right may still be no text, or longer than its room.
        note.check = note.sum();
        let _ = note.incident();
    }
}
