//! What the drives answer.

use crate::{Rig, ms, thesis_line};
use proptest::prelude::*;
use puente_cell::{Config, Fault};
use puente_modbus::Mode;

#[test]
fn exchanges_of_the_thesis_in_ascii() {
    let mut rig = Rig::of(Mode::Ascii);
    rig.drive_mut(1).force(0x1000, 0x0036);
    rig.drive_mut(1).force(0x0901, 0x0163);
    // Tables 4.5 and 4.6, figure 4.13.
    assert_eq!(rig.raw(b":010310000001EB\r\n"), b":0103020036C4\r\n");
    assert_eq!(rig.raw(b":010309010001F1\r\n"), b":010302016396\r\n");
    assert_eq!(rig.raw(b":01060025006470\r\n"), b":01060025006470\r\n");
    assert_eq!(rig.read(1, 0x0025), 100);
}

#[test]
fn exchanges_of_the_thesis_in_rtu() {
    let mut rig = Rig::of(Mode::Rtu);
    rig.drive_mut(1).force(0x1000, 0x0036);
    rig.drive_mut(1).force(0x0901, 0x0163);
    assert_eq!(rig.raw(b"\x01\x03\x10\x00\x00\x01\x80\xCA"), b"\x01\x03\x02\x00\x36\x38\x52");
    assert_eq!(rig.raw(b"\x01\x03\x09\x01\x00\x01\xD6\x56"), b"\x01\x03\x02\x01\x63\xF9\xFD");
    assert_eq!(rig.raw(b"\x01\x06\x00\x25\x00\x64\x99\xEA"), b"\x01\x06\x00\x25\x00\x64\x99\xEA");
    assert_eq!(rig.raw(b"\x01\x06\x10\x22\x00\x01\xEC\xC0"), b"\x01\x06\x10\x22\x00\x01\xEC\xC0");
    assert_eq!(rig.raw(b"\x01\x03\x08\x17\x00\x01\x36\x6E"), b"\x01\x03\x02\x00\x00\xB8\x44");
}

#[test]
fn a_released_register_reads_as_the_drive_makes_it() {
    let mut rig = Rig::of(Mode::Ascii);
    rig.drive_mut(1).force(0x0901, 0x8000);
    assert_eq!(rig.read(1, 0x0901), 0x8000);
    rig.drive_mut(1).release(0x0901);
    let expected = rig.drive(1).status().0;
    assert_eq!(rig.read(1, 0x0901), expected);
    assert_eq!(rig.drive(1).status().to_string(), "S-RDY,WAIT,AC-IN,TGON");
}

#[test]
fn refusals() {
    let mut rig = Rig::of(Mode::Ascii);
    for (request, expected) in [
        (&[0x03, 0x00, 0xDF, 0, 1][..], &[0x83, 2][..]), // past Pn222
        (&[0x03, 0x08, 0x06, 0, 19], &[0x83, 2]),        // runs past the monitor block
        (&[0x03, 0xFF, 0xFF, 0, 2], &[0x83, 2]),         // past the last address
        (&[0x03, 0x00, 0x00, 0, 21], &[0x83, 3]),        // more than 20 words
        (&[0x03, 0x00, 0x00, 0, 0], &[0x83, 3]),
        (&[0x03, 0x00], &[0x83, 3]),
        (&[0x06, 0x09, 0x01, 0, 0], &[0x86, 2]),    // read only
        (&[0x06, 0x00, 0x25, 0xFF, 0], &[0x86, 3]), // Pn037 out of range
        (&[0x06, 0x00, 0xD3, 0, 3], &[0x86, 3]),    // Pn211 is 0 to 2
        (&[0x06, 0x10, 0x24, 0, 2], &[0x86, 3]),    // 1 or 0
        (&[0x04, 0x09, 0x01, 0, 1], &[0x84, 1]),
        (&[0x08, 0, 0, 0, 0], &[0x88, 1]),
        (&[0x16, 0x10, 0x24, 0, 0, 0, 1], &[0x96, 1]),
        (&[0x41, 1, 2, 3], &[0xC1, 1]),
    ] {
        assert_eq!(rig.ask(2, request), expected, "{request:02X?}");
    }
    let thirteen = [&[0x10, 0, 0, 0, 13, 26][..], &[0; 26]].concat();
    assert_eq!(rig.ask(2, &thirteen), [0x90, 3]);
}

#[test]
fn several_registers_are_written_all_or_none() {
    let mut rig = Rig::of(Mode::Ascii);
    assert_eq!(rig.ask(1, &[0x10, 0, 0x24, 0, 2, 4, 0x11, 0x22, 0, 200]), [0x10, 0, 0x24, 0, 2]);
    assert_eq!((rig.read(1, 0x24), rig.read(1, 0x25)), (0x1122, 200));
    // Pn037 refuses the second word, so Pn036 keeps its value.
    assert_eq!(rig.ask(1, &[0x10, 0, 0x24, 0, 2, 4, 0, 1, 0xFF, 0]), [0x90, 3]);
    assert_eq!((rig.read(1, 0x24), rig.read(1, 0x25)), (0x1122, 200));
}

#[test]
fn the_monitor_block_is_one_read() {
    let mut rig = Rig::of(Mode::Ascii);
    rig.drive_mut(3).set_position(-12_345);
    let reply = rig.ask(3, &[0x03, 0x08, 0x06, 0, 18]);
    let words = puente_modbus::Words::from_bytes(&reply[2..]);
    let monitor = puente_drives::edb::Monitor::decode(words.iter()).expect("18 words");
    assert_eq!(monitor.position, -12_345);
    assert_eq!(monitor, rig.drive(3).monitor());
}

#[test]
fn parameters_at_power_up() {
    let mut rig = Rig::of(Mode::Ascii);
    assert_eq!(rig.read(3, 210), 3, "station address");
    assert_eq!((rig.read(3, 211), rig.read(3, 212), rig.read(3, 213)), (1, 5, 2), "thesis table 4.3");
    assert_eq!(rig.read(3, 222), 0);
}

#[test]
fn broadcasts_are_executed_and_not_answered() {
    let mut rig = Rig::of(Mode::Rtu);
    rig.cell.set_fault(3, Fault::Silent);
    let request = rig.frame(0, &[0x06, 0, 0x25, 0, 77]);
    assert_eq!(rig.raw(&request), []);
    assert_eq!((rig.read(1, 0x25), rig.read(2, 0x25)), (77, 77));
    rig.cell.set_fault(3, Fault::None);
    assert_eq!(rig.read(3, 0x25), 100, "a silent drive hears nothing");
}

#[test]
fn nobody_answers_for_an_absent_drive() {
    let mut rig = Rig::of(Mode::Ascii);
    let request = rig.frame(9, &[0x03, 0, 0, 0, 1]);
    assert_eq!(rig.raw(&request), []);
    assert!(rig.cell.drive(9).is_none() && !rig.cell.set_fault(9, Fault::Silent));
    assert_eq!(rig.cell.log().count(), 1, "it was heard all the same");
}

#[test]
fn frames_with_a_wrong_check_are_dropped() {
    let mut rig = Rig::of(Mode::Ascii);
    assert_eq!(rig.raw(b":010309010001F2\r\n"), []);
    assert_eq!(rig.cell.log().count(), 0);
    assert_eq!(rig.cell.events().count(), 1);
    assert_eq!(rig.raw(b":010310000001EB\r\n").len(), 15);
}

#[test]
fn an_echoing_line_repeats_what_is_sent_to_anyone() {
    let mut rig = Rig::new(Config { echo: true, ..Config::new(Mode::Ascii, thesis_line(), &[1]) });
    assert_eq!(rig.raw(b":090309010001E9\r\n"), b":090309010001E9\r\n");
    assert_eq!(rig.raw(b":01060025006470\r\n"), b":01060025006470\r\n:01060025006470\r\n");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn any_bytes_at_any_time_are_taken_without_panic(
        rtu in any::<bool>(),
        paced in any::<bool>(),
        bursts in prop::collection::vec((prop::collection::vec(any::<u8>(), 0..40), 0..50_u64), 1..20),
    ) {
        let mode = if rtu { Mode::Rtu } else { Mode::Ascii };
        let mut rig = Rig::new(Config { paced, ..Config::new(mode, thesis_line(), &[1, 2, 3]) });
        for (bytes, pause) in bursts {
            rig.cell.receive(rig.now, &bytes);
            rig.pass(ms(pause));
        }
        rig.pass(ms(3_000));
        // Whatever came: after a silence the cell understands again.
        rig.write(1, 0x25, 55);
        prop_assert_eq!(rig.read(1, 0x25), 55);
    }

    #[test]
    fn any_pdu_gets_an_answer_of_its_function(pdu in prop::collection::vec(any::<u8>(), 1..60)) {
        let mut rig = Rig::new(Config { paced: false, ..Config::new(Mode::Ascii, thesis_line(), &[1]) });
        let reply = rig.ask(1, &pdu);
        prop_assert_eq!(reply.first().map(|function| function & 0x7F), pdu.first().map(|function| function & 0x7F));
    }
}
