//! A stop reaches the drive: through a busy or broken line, and after whoever asked for it is gone.

mod common;

use std::io::Write;
use std::time::Instant;

use common::client::{Lines, Modbus, connect, mbap, read_pdu, reset, write_pdu};
use common::rig::{ENABLE, FORWARD, Rig};
use common::{MODES, ms, until};
use puente_cell::Fault;
use puente_modbus::Mode;

/// Lets a unit of the cell turn as if another master had started it: the gateway knows nothing of it, no lease is held.
fn turning(rig: &Rig) {
    let mut cell = rig.wire.device();
    let drive = cell.drive_mut(1).expect("drive 1");
    drive.write(ENABLE, 1).expect("enabled");
    drive.write(FORWARD, 1).expect("turning");
}

/// A reading of the silent drive 3 that keeps the line busy until its reply time-out; it has begun.
fn occupy(rig: &Rig) -> Modbus {
    assert!(rig.wire.device().set_fault(3, Fault::Silent));
    let mut client = Modbus::connect(rig.gateway.main);
    client.send(3, &read_pdu(0x0901, 1));
    until("the line is busy", || rig.wire.pdus(3).len() == 1);
    client
}

#[test]
fn a_stop_that_waits_for_the_line_is_sent_though_its_client_has_gone() {
    let stops: [(&str, Vec<u8>); 4] = [
        ("console stop", b"axis x stop\r\n".to_vec()),
        ("console disable", b"axis x disable\r\n".to_vec()),
        ("Modbus ASCII", b":010610240000C5\r\n".to_vec()),
        ("Modbus/TCP", mbap(7, 1, &write_pdu(FORWARD, 0))),
    ];
    for (what, stop) in stops {
        let rig = Rig::new(Mode::Rtu, 5000);
        turning(&rig);
        let _busy = occupy(&rig);
        let mut stream = connect(rig.gateway.main);
        stream.write_all(&stop).expect("sent");
        until("the stop is queued", || rig.gateway.bus_figure("waiting") > 0);
        assert!(rig.turns(), "the line is still busy");
        reset(stream);
        until(what, || !rig.turns());
    }
}

/// A drive that has not answered is left alone for a while, so that its late reply meets no other request. The stop of
/// its motor does not wait for that: nothing but its own repetition can be taken for it.
#[test]
fn a_stop_does_not_wait_for_the_quarantine_of_its_drive() {
    for mode in MODES {
        let rig = Rig::with(mode, 5000, "reply_timeout_ms = 300\nquarantine_ms = 8000");
        let (commander, _) = rig.jogging();
        assert!(rig.wire.device().set_fault(1, Fault::Lost.times(1)));
        let mut other = Modbus::connect(rig.gateway.main);
        assert_eq!(other.read(1, 0x0901, 1), Err(0x0B));
        let closed = Instant::now();
        drop(commander);
        let (before, late) = rig.stop_after(closed);
        println!("{mode:?}: stop on the wire {late:?} after the end, in a quarantine of 8 s");
        assert!(before == 0 && late < ms(2000), "{before} frames, {late:?}");
    }
}

#[test]
fn a_stop_without_confirmation_is_repeated_until_there_is_one() {
    let rig = Rig::with(Mode::Rtu, 5000, "reply_timeout_ms = 300");
    let (mut commander, _) = rig.jogging();
    // It hears neither the two writes of this stop nor of its first repetitions.
    assert!(rig.wire.device().set_fault(1, Fault::Silent.times(6)));
    let reply = commander.error("axis x stop", "no-reply");
    assert!(reply.contains("sent, no reply"), "{reply}");
    let (before, _) = (rig.wire.pdus(1).len(), drop(commander));
    until("x stands", || !rig.turns());
    assert!(rig.wire.pdus(1).len() > before, "by a stop of the gateway's own");
}

#[test]
fn a_stop_goes_on_after_the_drive_was_away_for_long() {
    let rig = Rig::with(Mode::Rtu, 5000, "reply_timeout_ms = 300\nquarantine_ms = 0");
    let (commander, _) = rig.jogging();
    assert!(rig.wire.device().set_fault(1, Fault::Silent));
    drop(commander);
    until("the gateway says that it cannot stop the axis", || rig.gateway.log().contains("stop-unconfirmed"));
    assert!(rig.turns());
    // Nobody gets the axis meanwhile.
    assert!(Lines::connect(rig.gateway.main).ask("axis x jog 10").starts_with("error "));
    assert!(rig.wire.device().set_fault(1, Fault::None));
    until("x stands", || !rig.turns());
    assert_eq!(rig.event(), "stop-unconfirmed");
    until("the axis is free", || Lines::connect(rig.gateway.main).ask("axis x jog 10").starts_with("ok"));
}
