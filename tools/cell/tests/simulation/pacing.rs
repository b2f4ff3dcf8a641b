//! Time on the wire.

use crate::{Rig, ms, thesis_line};
use puente_cell::{Config, Event, Fault};
use puente_line::{Instant, Settings};
use puente_modbus::{Mode, rtu};
use std::time::Duration;

const STATUS: &[u8] = b":010309010001F1\r\n";

#[test]
fn an_exchange_takes_the_45_ms_of_the_thesis() {
    let mut rig = Rig::of(Mode::Ascii);
    let start = rig.now;
    rig.cell.receive(start, STATUS);
    let pieces = rig.pass(ms(100));
    let line = thesis_line();
    assert_eq!(pieces.len(), 15, "a character at a time");
    for (at, (moment, piece)) in pieces.iter().enumerate() {
        assert_eq!(piece.len(), 1);
        assert_eq!(*moment, start + line.wire_time(17) + ms(8) + line.wire_time(at + 1));
    }
    let whole = pieces[14].0.since(start);
    assert!(whole > ms(44) && whole < ms(46), "{whole:?}");
}

#[test]
fn an_rtu_reply_keeps_the_silence() {
    for (delay, expected) in [(ms(0), rtu::t3_5(thesis_line())), (ms(20), ms(20))] {
        let config = Config { reply_delay: delay, ..Config::new(Mode::Rtu, thesis_line(), &[1]) };
        let mut rig = Rig::new(config);
        let start = rig.now;
        rig.cell.receive(start, b"\x01\x03\x09\x01\x00\x01\xD6\x56");
        let first = rig.pass(ms(100))[0].0;
        assert_eq!(first, start + thesis_line().wire_time(8) + expected + thesis_line().wire_time(1));
    }
}

#[test]
fn a_burst_waits_for_the_one_before() {
    let mut rig = Rig::of(Mode::Ascii);
    let start = rig.now;
    // The second request is handed over while the first is still under way.
    rig.cell.receive(start, STATUS);
    rig.cell.receive(start + ms(5), b":020309010001F0\r\n");
    rig.pass(ms(200));
    let times: Vec<Instant> = rig.cell.log().map(|(at, ..)| at).collect();
    assert_eq!(times, [start + thesis_line().wire_time(17), start + thesis_line().wire_time(34)]);
}

#[test]
fn a_request_in_pieces_is_complete_with_its_last_character() {
    let mut rig = Rig::of(Mode::Ascii);
    let start = rig.now;
    rig.cell.receive(start, &STATUS[..16]);
    rig.pass(ms(100));
    rig.cell.receive(start + ms(100), &STATUS[16..]);
    rig.pass(ms(100));
    let (at, unit, pdu) = rig.cell.log().next().expect("a request");
    assert_eq!((at, unit), (start + ms(100) + thesis_line().wire_time(1), 1));
    assert_eq!(pdu, [0x03, 0x09, 0x01, 0, 1]);
}

#[test]
fn late_polls_change_no_moment() {
    let run = |polled: bool| {
        let mut rig = Rig::of(Mode::Rtu);
        let start = rig.now;
        for at in 0..4 {
            rig.cell.receive(start + ms(60 * at), &rig.frame(1, &[0x03, 0x08, 0x06, 0, 1]));
            if polled {
                rig.pass(ms(60));
            }
        }
        rig.now = start + ms(1_000);
        rig.cell.poll(rig.now);
        rig.cell.events().cloned().collect::<Vec<(Instant, Event)>>()
    };
    assert_eq!(run(true).len(), 8);
    let sorted = |mut events: Vec<(Instant, Event)>| {
        events.sort_by_key(|(at, _)| *at);
        events
    };
    assert_eq!(sorted(run(true)), sorted(run(false)));
}

#[test]
fn the_floor_of_a_fast_line_is_wire_time_and_silences() {
    let line = Settings { baud: 115_200, format: "8E1".parse().expect("format") };
    let mut config = Config { reply_delay: Duration::ZERO, ..Config::new(Mode::Rtu, line, &[1]) };
    config.drives[0].profile.max_read = 125;
    let mut rig = Rig::new(config);
    let start = rig.now;
    rig.cell.receive(start, &rig.frame(1, &[0x03, 0, 0, 0, 125]));
    let pieces = rig.pass(ms(100));
    let (last, _) = pieces[pieces.len() - 1];
    assert_eq!(pieces.iter().map(|(_, piece)| piece.len()).sum::<usize>(), 255);
    assert_eq!(last, start + line.wire_time(8) + rtu::t3_5(line) + line.wire_time(255));
}

#[test]
fn an_unpaced_line_waits_for_the_delay_only() {
    for mode in [Mode::Rtu, Mode::Ascii] {
        let mut rig = Rig::new(Config { paced: false, ..Config::new(mode, thesis_line(), &[1]) });
        let start = rig.now;
        rig.cell.receive(start, &rig.frame(1, &[0x03, 0x09, 0x01, 0, 1]));
        let pieces = rig.pass(ms(100));
        assert_eq!(pieces.len(), 1);
        assert_eq!(pieces[0].0, start + ms(8));
    }
}

#[test]
fn an_idle_cell_asks_for_no_poll() {
    let mut rig = Rig::of(Mode::Ascii);
    assert_eq!(rig.cell.poll_at(), None);
    rig.raw(STATUS);
    rig.write(1, 0x1023, 1);
    rig.write(1, 0x1024, 1);
    assert_eq!(rig.cell.poll_at(), None, "not even while a motor turns");
}

#[test]
fn an_echo_is_heard_while_the_request_is_sent() {
    let mut rig = Rig::new(Config { echo: true, ..Config::new(Mode::Ascii, thesis_line(), &[1]) });
    let start = rig.now;
    rig.cell.set_fault(1, Fault::Silent);
    rig.cell.receive(start, STATUS);
    let pieces = rig.pass(ms(100));
    assert_eq!(pieces.len(), STATUS.len());
    assert_eq!(pieces[16].0, start + thesis_line().wire_time(17));
}

#[test]
fn time_never_goes_back() {
    let mut rig = Rig::of(Mode::Ascii);
    rig.cell.poll(Instant::from_millis(5_000));
    rig.cell.receive(Instant::from_millis(1_000), STATUS);
    rig.now = Instant::from_millis(5_000);
    rig.pass(ms(100));
    let (at, ..) = rig.cell.log().next().expect("a request");
    assert_eq!(at, Instant::from_millis(5_000) + thesis_line().wire_time(17));
}
