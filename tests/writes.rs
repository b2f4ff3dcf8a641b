//! Writes: never twice, in the right order, and with an honest outcome.

mod common;

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use common::client::{Lines, Modbus, connect, read_pdu, reset, write_pdu};
use common::rig::{ENABLE, FORWARD, REVERSE, Rig};
use common::{Ends, MODES, ms, until};
use puente_cell::Fault;
use puente_modbus::Mode;

const SPEED: u16 = 0x0025;
const CLEAR: u16 = 0x1022;

/// The writes to drive 1 so far, as register and value.
fn writes(rig: &Rig) -> Vec<(u16, u16)> {
    let word = |pdu: &[u8], at: usize| u16::from_be_bytes([pdu[at], pdu[at + 1]]);
    let pdus = rig.wire.pdus(1);
    pdus.iter().filter(|pdu| pdu[0] == 6).map(|pdu| (word(pdu, 1), word(pdu, 3))).collect()
}

fn lose_next_reply(rig: &Rig) {
    assert!(rig.wire.device().set_fault(1, Fault::Lost.times(1)));
}

#[test]
fn a_write_whose_reply_is_lost_is_on_the_wire_once_and_reported_as_sent_without_reply() {
    for mode in MODES {
        let rig = Rig::with(mode, 250, "reply_timeout_ms = 300");
        let mut console = Lines::connect(rig.gateway.main);
        let mut modbus = Modbus::connect(rig.gateway.modbus);
        let several = [0x10, 0, 0x25, 0, 1, 2, 0, 152];
        for number in 0..4 {
            // Otherwise the drive would be left alone for a while, and the write not sent.
            until("the drive answers", || modbus.read(1, SPEED, 1).is_ok());
            lose_next_reply(&rig);
            match number {
                0 => {
                    let reply = console.error("axis x set Pn037 150", "no-reply");
                    assert!(reply.contains("sent, no reply"), "{reply}");
                }
                1 => assert_eq!(modbus.write(1, SPEED, 151), Err(0x0B)),
                2 => assert_eq!(modbus.ask(1, &several), [0x90, 0x0B]),
                _ => assert_eq!(console.ask(":0106002500993B"), ":01860B6E"),
            }
        }
        // The drive answers again; nothing was repeated meanwhile or later.
        assert_eq!(modbus.read(1, SPEED, 1), Ok(vec![153]), "each was executed");
        assert_eq!(writes(&rig), [(SPEED, 150), (SPEED, 151), (SPEED, 153)], "{mode:?}");
        assert_eq!(rig.wire.pdus(1).iter().filter(|pdu| **pdu == several).count(), 1);
    }
}

#[test]
fn a_jog_whose_reply_is_lost_may_be_running_and_is_stopped_at_the_end_of_the_lease() {
    let rig = Rig::with(Mode::Rtu, 300, "reply_timeout_ms = 300");
    let mut console = Lines::connect(rig.gateway.main);
    console.ok("axis x enable");
    // Status, speed, then the direction, whose reply is lost.
    assert!(rig.wire.device().set_fault(1, Fault::None.times_then(2, Fault::Lost.times(1))));
    let reply = console.error("axis x jog 100", "no-reply");
    assert!(reply.contains("sent, no reply"), "{reply}");
    assert_eq!(writes(&rig).iter().filter(|write| **write == (FORWARD, 1)).count(), 1);
    until("x stands", || !rig.turns());
    assert_eq!(rig.event(), "lease-expired");
}

#[test]
fn enabling_clears_what_would_make_the_motor_jump() {
    for mode in MODES {
        let rig = Rig::new(mode, 250);
        let mut console = Lines::connect(rig.gateway.main);
        console.ok("axis x enable");
        assert_eq!(writes(&rig), [(FORWARD, 0), (REVERSE, 0), (ENABLE, 1)], "{mode:?}");
    }
}

#[test]
fn an_enable_that_cannot_clear_them_does_not_enable() {
    for number in 1..=2 {
        let rig = Rig::with(Mode::Rtu, 250, "reply_timeout_ms = 300");
        let fault = Fault::None.times_then(number, Fault::Silent.times(1));
        assert!(rig.wire.device().set_fault(1, fault));
        let mut console = Lines::connect(rig.gateway.main);
        console.error("axis x enable", "no-reply");
        assert!(!writes(&rig).contains(&(ENABLE, 1)));
    }
}

#[test]
fn clearing_an_alarm_starts_nothing() {
    let rig = Rig::new(Mode::Ascii, 5000);
    let (mut commander, _) = rig.jogging();
    rig.wire.device().drive_mut(1).expect("drive 1").set_alarm(4);
    assert!(commander.ok("axis x alarm").contains("alarm=4 "));
    commander.error("axis x enable", "alarm");
    let before = writes(&rig).len();
    commander.ok("axis x clear");
    assert_eq!(writes(&rig)[before..], [(FORWARD, 0), (REVERSE, 0), (ENABLE, 0), (CLEAR, 1)]);
    commander.error("axis x jog 100", "not-enabled");
    thread::sleep(ms(300));
    assert!(!rig.turns());
    // The axis was at rest when it was cleared: no event is to come of its old lease.
    assert_eq!(rig.event(), "none");
    drop(commander);
    thread::sleep(ms(300));
    assert_eq!(rig.event(), "none");
}

#[test]
fn nothing_is_written_by_a_jog_that_is_refused() {
    let rig = Rig::new(Mode::Ascii, 250);
    let mut console = Lines::connect(rig.gateway.main);
    console.error("axis x jog 100", "not-enabled");
    for rpm in ["3001", "-3001", "2147483647", "-2147483648"] {
        console.error(&format!("axis x jog {rpm}"), "range");
    }
    console.error("axis x jog 2147483648", "number");
    console.error("axis w jog 1", "unknown-axis");
    assert_eq!(writes(&rig), []);
}

#[test]
fn a_write_that_still_waits_when_its_client_goes_is_never_sent() {
    let rig = Rig::new(Mode::Rtu, 250);
    assert!(rig.wire.device().set_fault(3, Fault::Silent));
    let mut busy = Modbus::connect(rig.gateway.main);
    busy.send(3, &read_pdu(0x0901, 1));
    until("the line is busy", || rig.wire.pdus(3).len() == 1);
    let mut stream = connect(rig.gateway.main);
    stream.write_all(&common::client::mbap(1, 1, &write_pdu(SPEED, 7))).expect("sent");
    until("the write is queued", || rig.gateway.bus_figure("waiting") == 1);
    reset(stream);
    until("it is not queued any more", || rig.gateway.bus_figure("waiting") == 0);
    busy.receive();
    assert!(busy.read(2, 0x0901, 1).is_ok());
    assert_eq!(writes(&rig), []);
}

/// Fifteen others poll without a pause: a jog needs seven transactions and gets one in sixteen of the line.
#[test]
fn a_jog_starts_on_a_line_that_fifteen_others_keep_busy() {
    let rig = Rig::new(Mode::Ascii, 250);
    let running = AtomicBool::new(true);
    thread::scope(|scope| {
        let _ends = Ends(&running);
        for number in 0..15 {
            let (running, address) = (&running, rig.gateway.main);
            scope.spawn(move || {
                let mut client = Modbus::connect(address);
                while running.load(Ordering::Relaxed) {
                    assert!(client.read(1 + number % 3, 0x0901, 1).is_ok());
                }
            });
        }
        until("all poll", || rig.wire.requests().len() > 15);
        let mut console = Lines::connect(rig.gateway.main);
        let replies = [console.ask("axis x enable"), console.ask("axis x jog 100")];
        let turned = rig.turns();
        assert!(replies.iter().all(|reply| reply.starts_with("ok")) && turned, "{replies:?}");
    });
}
